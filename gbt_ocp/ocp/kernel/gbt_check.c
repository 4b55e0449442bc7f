#include "gbt_check.h"

#include "gbt_form.h"
#include "gbt_math.h"

void gbt_moving_at(const gbt_real *ends, gbt_real share, gbt_real *place)
{
    for (int m = 0; m < GBT_KNOT_NUMBERS; m++)
        place[GBT_POINT + m] = (1 - share) * ends[m] + share * ends[GBT_KNOT_NUMBERS + m];
}

/* The larger of worst and the violation of a limit at a place. */
static gbt_real worst_of(const gbt_limit *limit, const gbt_real *place, gbt_real worst)
{
    gbt_real value[GBT_ROWS];
    limit->value(place, 0, 0, value);
    for (int r = 0; r < limit->sides; r++) {
        const gbt_real over = limit->sign[r] * value[limit->row[r]] - limit->edge[r];
        if (isnan(over)) return GBT_INFINITY;
        if (over > worst) worst = over;
    }
    return worst;
}

static void survey_piece(gbt_piece piece, const gbt_real *moving, int points, int at_start,
                         gbt_real worst[GBT_LIMITS + 1])
{
    gbt_real place[GBT_PLACE];
    for (int q = 0; q < GBT_LIMITS; q++) worst[q] = -GBT_INFINITY;
    int others = 0; /* that nodes do not tell enough of */
    for (int q = 0; q < GBT_LIMITS; q++) {
        if (points != GBT_NODES && !gbt_limits[q].steady) {
            others++;
            continue;
        }
        for (int k = at_start && gbt_limits[q].given; k <= gbt_limits[q].intervals; k++) {
            const gbt_real share = (gbt_real)k / (gbt_real)gbt_limits[q].intervals;
            gbt_place_after(piece, share, place);
            gbt_moving_at(moving, share, place);
            worst[q] = worst_of(&gbt_limits[q], place, worst[q]);
        }
    }
    if (others == 0) return;
    for (int k = 0; k < points; k++) {
        const gbt_real share = (gbt_real)k / (gbt_real)(points - 1);
        gbt_place_after(piece, share, place);
        gbt_moving_at(moving, share, place);
        for (int q = 0; q < GBT_LIMITS; q++)
            if (!gbt_limits[q].steady && !(at_start && k == 0 && gbt_limits[q].given))
                worst[q] = worst_of(&gbt_limits[q], place, worst[q]);
    }
}

/* Puts piece number i in its place, after the one before it, which is spent. */
static void load_piece(const gbt_real *start, const gbt_real *top, int i, gbt_piece piece)
{
    gbt_piece end;
    if (i > 0) gbt_next_piece(piece, end);
    for (int a = 0; a < GBT_STATE; a++)
        *gbt_inherited(piece, a) = i > 0 ? *gbt_inherited(end, a) : start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = top[i * GBT_FREE + a];
}

void gbt_survey(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
                gbt_real worst[][GBT_LIMITS + 1])
{
    gbt_piece piece;
    for (int i = 0; i < pieces; i++) {
        load_piece(start, top, i, piece);
        survey_piece(piece, moving + i * GBT_KNOT_NUMBERS, points, i == 0, worst[i]);
    }
}

void gbt_check(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
               gbt_real *violation)
{
    gbt_piece piece;
    gbt_real worst[GBT_LIMITS + 1];
    for (int i = 0; i < pieces; i++) {
        load_piece(start, top, i, piece);
        survey_piece(piece, moving + i * GBT_KNOT_NUMBERS, points, i == 0, worst);
        violation[i] = -GBT_INFINITY;
        for (int q = 0; q < GBT_LIMITS; q++)
            if (gbt_limits[q].judged && worst[q] > violation[i]) violation[i] = worst[q];
    }
}

void gbt_broken_at_start(const gbt_real *start, const gbt_real *moving, gbt_real violation[GBT_LIMITS + 1])
{
    gbt_real place[GBT_PLACE];
    for (int a = 0; a < GBT_POINT; a++) place[a] = a < GBT_MOTION ? start[a] : 0;
    gbt_moving_at(moving, 0, place);
    for (int q = 0; q < GBT_LIMITS; q++)
        violation[q] = gbt_limits[q].given ? worst_of(&gbt_limits[q], place, 0) : 0;
}
