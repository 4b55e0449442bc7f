#include "gbt_trajectory.h"

#include "gbt_math.h"
#include "gbt_pieces.h"

#define SAME_TIME 1e-9 /* rounding of a time, in pieces: a boundary belongs to the later one */

void gbt_trajectory_at(const gbt_follower *plan, double seconds, gbt_real derivatives[GBT_ORDERS][GBT_FLAT])
{
    const double pieces = floor(seconds / (double)GBT_PERIOD + SAME_TIME);
    const int number = pieces >= GBT_PIECES ? GBT_PIECES - 1 : pieces > 0 ? (int)pieces : 0;
    gbt_real piece[GBT_ORDERS][GBT_FLAT], power[GBT_ORDERS];
    for (int l = 0; l < GBT_JOINED + GBT_REMEMBERED; l++)
        for (int j = 0; j < GBT_FLAT; j++)
            piece[l][j] = l == GBT_JOINED || (l == 0 && j < GBT_DIMENSION) ? 0 : plan->start[l][j];
    for (int i = 0;; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = plan->top[i][a];
        if (i == number) break;
        gbt_next_piece(piece, piece);
    }
    gbt_taylor((gbt_real)(seconds - number * (double)GBT_PERIOD), power);
    for (int o = 0; o < GBT_DERIVATIVES; o++)
        for (int j = 0; j < GBT_FLAT; j++) {
            derivatives[o][j] = piece[GBT_ROW(o)][j];
            for (int k = 1; o + k < GBT_DERIVATIVES; k++) derivatives[o][j] += power[k] * piece[GBT_ROW(o + k)][j];
        }
}
