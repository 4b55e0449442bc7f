/* What the flat form does where the solver fails: slow down within the thrust, by a few projections and without any
   solver, or bring the first piece of a plan within the thrust by the same projections.

   Limits besides those of the thrust are not looked at. A piece starts from the acceleration that stops within it.
   Wherever the thrust of that exceeds its limits, the acceleration is moved by what the excess of thrust accelerates, point
   by point along the piece and again until no point exceeds any more. Where a bounded number of rounds does not end that,
   drifting is the second start, and the piece that breaks the limits less is taken, of two that keep them the one that ends
   slower. */
#include "gbt_pieces.h"

#include "gbt_math.h"
#include "gbt_thrust.h"

#define POINTS 11 /* of a piece at which its thrust is held within the limits, both ends included */
#define FIRST (GBT_JOINED == 2 ? 0 : 1) /* of them that the lowest free derivative moves */
#define ROUNDS 20 /* of projections over these points, at most */
#define PROGRESS ((gbt_real)1e-4) /* by which a round has to be better: rounding must not decide what follows */
#define INSIDE ((gbt_real)0.995) /* share of the limits that a projection leads to: between the points thrust may bulge */

#define MENDABLE ((gbt_real)0.1) /* excess up to which a piece is mended: beyond, little of its plan would be left */

/* The point of a piece with that number, and its thrust; returns by how much that exceeds its limits, at least 0. */
static gbt_real excess(gbt_piece piece, int k, gbt_real *point, gbt_real *thrust)
{
    gbt_real worst = 0;
    gbt_point_after(piece, GBT_PERIOD * (gbt_real)k / (POINTS - 1), point);
    gbt_vehicle_inputs(point, 0, 0, thrust);
    for (int m = 0; m < GBT_INPUTS; m++) {
        const gbt_real over = gbt_thrust_used(m, thrust[m]) - 1;
        if (isnan(over)) return GBT_INFINITY;
        if (over > worst) worst = over;
    }
    return worst;
}

/* The largest of all points. */
static gbt_real worst_of(gbt_piece piece)
{
    gbt_real point[GBT_POINT], thrust[GBT_INPUTS], worst = 0;
    for (int k = FIRST; k < POINTS; k++) worst = gbt_fmax(worst, excess(piece, k, point, thrust));
    return worst;
}

/* Moves the lowest free derivative by a share of what brings the thrust at a point within its limits. */
static void project(gbt_piece piece, int k, gbt_real share, const gbt_real *point,
                    gbt_real *thrust)
{
    gbt_real power[GBT_ORDERS], within[GBT_FLAT];
    int finite = 1;
    gbt_taylor(GBT_PERIOD * (gbt_real)k / (POINTS - 1), power);
    for (int m = 0; m < GBT_INPUTS; m++) thrust[m] = gbt_within_thrust(m, thrust[m], INSIDE);
    gbt_vehicle_acceleration(point, point + GBT_FLAT, thrust, within);
    for (int j = 0; j < GBT_FLAT; j++) {
        within[j] = (within[j] - point[2 * GBT_FLAT + j]) / power[GBT_JOINED - 2];
        if (!isfinite(within[j])) finite = 0;
    }
    for (int j = 0; j < GBT_FLAT && finite; j++) piece[GBT_ROW(GBT_JOINED)][j] += share * within[j];
}

/* The best of a few rounds from the one that the piece has, into best; returns by how much its thrust exceeds the limits. */
static gbt_real projected(gbt_piece piece, gbt_real best[GBT_FLAT])
{
    gbt_real point[GBT_POINT], thrust[GBT_INPUTS], least = GBT_INFINITY, share = 1;
    for (int j = 0; j < GBT_FLAT; j++) best[j] = piece[GBT_ROW(GBT_JOINED)][j];
    for (int round = 0; round < ROUNDS; round++) {
        const gbt_real worst = worst_of(piece);
        if (worst <= 0 || worst < least - PROGRESS) {
            least = worst;
            for (int j = 0; j < GBT_FLAT; j++) best[j] = piece[GBT_ROW(GBT_JOINED)][j];
        } else {
            share /= 2;
        }
        if (!(worst > 0)) break;
        for (int k = FIRST; k < POINTS; k++)
            if (excess(piece, k, point, thrust) > 0) project(piece, k, share, point, thrust);
    }
    return least;
}

/* Fills in the lowest free derivative; those above it brake nothing and are zero. */
static void brake_piece(gbt_piece piece)
{
    static const gbt_real idle[GBT_INPUTS], rest[GBT_FLAT];
    gbt_real next[GBT_ORDERS][GBT_FLAT], drift[GBT_FLAT], best[GBT_FLAT];
    gbt_real least = GBT_INFINITY, slowest = GBT_INFINITY;
    gbt_vehicle_acceleration(piece[0], piece[1], idle, drift);
    for (int j = 0; j < GBT_FLAT; j++) best[j] = 0;
    for (int start = 0; start < 2; start++) {
        gbt_real found[GBT_FLAT], speed = 0;
        for (int j = 0; j < GBT_FLAT; j++) {
            if (!isfinite(drift[j])) drift[j] = 0;
        }
        gbt_settle(piece, start == 0 ? 1 : 2, start == 0 ? rest : drift);
        const gbt_real broken = projected(piece, found);
        for (int j = 0; j < GBT_FLAT; j++) piece[GBT_ROW(GBT_JOINED)][j] = found[j];
        gbt_next_piece(piece, next);
        for (int j = 0; j < GBT_FLAT; j++) {
            const gbt_real scaled = next[1][j] / gbt_acceleration_scale[j];
            speed += scaled * scaled;
        }
        if (broken < least || (broken == least && speed < slowest)) {
            least = broken;
            slowest = speed;
            for (int j = 0; j < GBT_FLAT; j++) best[j] = found[j];
        }
        if (broken <= 0) break;
    }
    for (int j = 0; j < GBT_FLAT; j++) piece[GBT_ROW(GBT_JOINED)][j] = best[j];
}

int gbt_mend(const gbt_real *start, gbt_real *top)
{
    gbt_piece piece, change;
    gbt_real within[GBT_FLAT], off[GBT_STATE];
    for (int a = 0; a < GBT_STATE; a++) {
        piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
        change[a / GBT_FLAT][a % GBT_FLAT] = 0;
    }
    for (int a = 0; a < GBT_FREE; a++) {
        *gbt_free(piece, a) = top[a];
        *gbt_free(change, a) = 0;
    }
    if (!(worst_of(piece) <= MENDABLE) || projected(piece, within) > 0) return 0;
    for (int j = 0; j < GBT_FLAT; j++) {
        *gbt_free(change, j) = within[j] - top[j];
        top[j] = within[j];
    }
    gbt_next_piece(change, change);
    for (int a = 0; a < GBT_STATE; a++) off[a] = change[a / GBT_FLAT][a % GBT_FLAT];
    gbt_lead_back(off, GBT_PIECES - 1, top + GBT_FREE);
    return 1;
}

void gbt_brake(const gbt_real *start, gbt_real *top)
{
    gbt_piece piece;
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        brake_piece(piece);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, piece);
    }
}
