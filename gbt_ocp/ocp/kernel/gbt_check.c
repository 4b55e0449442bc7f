#include "gbt_check.h"

#include "gbt_math.h"
#include "gbt_pieces.h"

static gbt_real worst_at(const gbt_real *point, int at_start, gbt_real worst)
{
    gbt_real value[GBT_ROWS];
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        if (!limit->judged || (at_start && limit->given)) continue;
        limit->value(point, 0, 0, value);
        for (int r = 0; r < limit->sides; r++) {
            const gbt_real over = limit->sign[r] * value[limit->row[r]] - limit->edge[r];
            if (isnan(over)) return GBT_INFINITY;
            if (over > worst) worst = over;
        }
    }
    return worst;
}

void gbt_check(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
               gbt_real *violation)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], end[GBT_ORDERS][GBT_FLAT], point[GBT_PLACE];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int i = 0; i < pieces; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = top[i * GBT_FREE + a];
        violation[i] = -GBT_INFINITY;
        for (int k = 0; k < points; k++) {
            const gbt_real share = (gbt_real)k / (gbt_real)(points - 1);
            gbt_point_after(piece, GBT_PERIOD * share, point);
            gbt_moving_at(moving + i * GBT_MOVING, share, point);
            violation[i] = worst_at(point, i == 0 && k == 0, violation[i]);
        }
        gbt_next_piece(piece, end);
        for (int l = 0; l < GBT_JOINED; l++)
            for (int j = 0; j < GBT_FLAT; j++) piece[l][j] = end[l][j];
    }
}
