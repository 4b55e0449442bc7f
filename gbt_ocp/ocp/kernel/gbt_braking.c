#include "gbt_braking.h"

#include <tgmath.h>

#include "gbt_check.h"
#include "gbt_pieces.h"

#define SHARES 11

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

static void brake_piece(gbt_real piece[GBT_ORDERS][GBT_FLAT])
{
    gbt_real drift[GBT_FLAT], stop[GBT_FLAT], best[GBT_FLAT], next[GBT_ORDERS][GBT_FLAT];
    gbt_real least = HUGE_VAL, slowest = HUGE_VAL;
    gbt_vehicle_drift(piece[0], piece[1], 0, drift);
    for (int j = 0; j < GBT_FLAT; j++) {
        stop[j] = -piece[1][j] / GBT_PERIOD;
        if (GBT_DEGREE > 2) {
            /* The unknown is a higher derivative: aim the acceleration at the end of the piece instead. */
            const gbt_real reach = pow(GBT_PERIOD, (gbt_real)(GBT_DEGREE - 2));
            drift[j] = (drift[j] - piece[GBT_DEGREE > 2 ? 2 : 0][j]) / reach;
            stop[j] = (stop[j] - piece[GBT_DEGREE > 2 ? 2 : 0][j]) / reach;
        }
        if (!isfinite(drift[j])) drift[j] = 0;
        best[j] = drift[j];
    }
    for (int a = 0; a < SHARES; a++)
        for (int b = 0; b < 4; b++) {
            /* Yaw brakes by its own share: a fast turn and a fast drift need different ones. */
            const gbt_real share = (gbt_real)a / (SHARES - 1), last = b == 0 ? share : (gbt_real)(b - 1) / 2;
            gbt_real broken, speed;
            for (int j = 0; j < GBT_FLAT; j++)
                piece[GBT_DEGREE][j] = drift[j] + (j == GBT_FLAT - 1 ? last : share) * (stop[j] - drift[j]);
            gbt_check(&piece[0][0], piece[GBT_DEGREE], 1, GBT_FINE_POINTS, &broken);
            if (broken < 0) broken = 0;
            speed = end_speed(piece, next);
            if (broken < least || (broken == least && speed < slowest)) {
                least = broken;
                slowest = speed;
                for (int j = 0; j < GBT_FLAT; j++) best[j] = piece[GBT_DEGREE][j];
            }
        }
    for (int j = 0; j < GBT_FLAT; j++) piece[GBT_DEGREE][j] = best[j];
}

void gbt_brake(const gbt_real *start, gbt_real *top)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], next[GBT_ORDERS][GBT_FLAT];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        brake_piece(piece);
        for (int j = 0; j < GBT_FLAT; j++) top[i * GBT_FLAT + j] = piece[GBT_DEGREE][j];
        gbt_next_piece(piece, next);
        for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = next[a / GBT_FLAT][a % GBT_FLAT];
    }
}
