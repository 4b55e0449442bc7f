#include "gbt_braking.h"

#include "gbt_check.h"
#include "gbt_math.h"
#include "gbt_pieces.h"

#define SHARES 12 /* from drifting to stopping by halves: a stop may take a thousand times the thrust there is */
#define ROUNDS 12 /* of the pattern search around the best of the family */
#define AT_REST ((gbt_real)1e-16) /* sum of squares of speeds, over their scales, that counts as none */

/* The best lowest free derivative of a piece so far, those above it being zero: what breaks the limits less, and among those that keep them ends slower. */
typedef struct {
    gbt_real top[GBT_FLAT], broken, speed;
} candidate;

static gbt_real end_speed(gbt_real piece[GBT_ORDERS][GBT_FLAT], gbt_real next[GBT_ORDERS][GBT_FLAT])
{
    gbt_real sum = 0;
    gbt_next_piece(piece, next);
    for (int j = 0; j < GBT_FLAT; j++) {
        const gbt_real speed = next[1][j] / gbt_acceleration_scale[j];
        sum += speed * speed;
    }
    return sum;
}

/* Tries piece[GBT_JOINED]; returns 1 if it is better than the best. */
static int improve(gbt_real piece[GBT_ORDERS][GBT_FLAT], const gbt_real *moving, candidate *best)
{
    gbt_real next[GBT_ORDERS][GBT_FLAT], broken, speed;
    gbt_check(&piece[0][0], piece[GBT_JOINED], 1, GBT_FINE_POINTS, moving, &broken);
    if (broken < 0) broken = 0;
    speed = end_speed(piece, next);
    if (!(broken < best->broken || (broken == best->broken && speed < best->speed))) return 0;
    best->broken = broken;
    best->speed = speed;
    for (int j = 0; j < GBT_FLAT; j++) best->top[j] = piece[GBT_JOINED][j];
    return 1;
}

static void brake_piece(gbt_real piece[GBT_ORDERS][GBT_FLAT], const gbt_real *moving)
{
    gbt_real drift[GBT_FLAT], stop[GBT_FLAT], reach = (gbt_real)0.25;
    candidate best;
    best.broken = best.speed = GBT_INFINITY;
    gbt_vehicle_drift(piece[0], piece[1], 0, drift);
    for (int j = 0; j < GBT_FLAT; j++) {
        stop[j] = -piece[1][j] / GBT_PERIOD;
        if (GBT_JOINED > 2) {
            /* The acceleration is inherited: aim the one at the end of the piece instead. */
            const gbt_real lag = gbt_pow(GBT_PERIOD, (gbt_real)(GBT_JOINED - 2));
            drift[j] = (drift[j] - piece[2][j]) / lag;
            stop[j] = (stop[j] - piece[2][j]) / lag;
        }
        if (!isfinite(drift[j])) drift[j] = 0;
        best.top[j] = drift[j];
        piece[GBT_JOINED][j] = stop[j];
    }
    improve(piece, moving, &best);
    if (best.broken == 0 && best.speed < AT_REST) return; /* nothing ends slower */
    for (int a = 0; a < SHARES; a++)
        for (int b = 0; b < 4; b++) {
            /* Yaw brakes by its own share: a fast turn and a fast drift need different ones. */
            const gbt_real share = a == 0 ? 0 : gbt_pow((gbt_real)0.5, (gbt_real)(SHARES - 1 - a));
            const gbt_real last = b == 0 ? share : (gbt_real)(b - 1) / 2;
            for (int j = 0; j < GBT_FLAT; j++)
                piece[GBT_JOINED][j] = drift[j] + (j == GBT_FLAT - 1 ? last : share) * (stop[j] - drift[j]);
            improve(piece, moving, &best);
        }
    /* Fast turns couple the axes: then no mixture of drifting and stopping may keep the limits. */
    for (int round = 0; round < ROUNDS; round++) {
        int moved = 0;
        for (int axis = 0; axis < GBT_FLAT; axis++)
            for (int sign = 1; sign >= -1; sign -= 2) {
                for (int j = 0; j < GBT_FLAT; j++) piece[GBT_JOINED][j] = best.top[j];
                piece[GBT_JOINED][axis] += (gbt_real)sign * reach * gbt_input_scale[axis];
                if (improve(piece, moving, &best)) moved = 1;
            }
        if (!moved) reach /= 2;
    }
    for (int j = 0; j < GBT_FLAT; j++) piece[GBT_JOINED][j] = best.top[j];
}

void gbt_brake(const gbt_real *start, const gbt_real *moving, gbt_real *top)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], next[GBT_ORDERS][GBT_FLAT];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        brake_piece(piece, moving + i * GBT_MOVING);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, next);
        for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = next[a / GBT_FLAT][a % GBT_FLAT];
    }
}
