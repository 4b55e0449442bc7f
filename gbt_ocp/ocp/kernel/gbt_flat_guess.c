/* Trajectories of the flat form that no solver made: where one begins, and what is left of one. */
#include "gbt_pieces.h"

#include "gbt_math.h"

void gbt_settle(gbt_piece piece, int first, const gbt_real *aim)
{
    /* The gains that bring a chain of so many integrators to rest in as many steps of one second (all poles at zero). */
    static const gbt_real gain[4][4] = {
        {1},
        {1, (gbt_real)3 / 2},
        {1, 2, (gbt_real)11 / 6},
        {1, (gbt_real)5 / 2, (gbt_real)35 / 12, (gbt_real)25 / 12},
    };
    const int inherited = GBT_JOINED - first;
    for (int j = 0; j < GBT_FLAT; j++) {
        gbt_real value = inherited == 0 ? aim[j] : 0;
        for (int i = 0; i < inherited; i++)
            value -= gain[inherited - 1][i] * (piece[first + i][j] - (i == 0 ? aim[j] : 0)) /
                     gbt_pow(GBT_PERIOD, (gbt_real)(inherited - i));
        piece[GBT_ROW(GBT_JOINED)][j] = value;
    }
}

/* What the vehicle is off comes to rest, of which a trajectory and where it begins are linear. */
void gbt_lead_back(const gbt_real *off, int pieces, gbt_real *top)
{
    static const gbt_real rest[GBT_FLAT];
    gbt_piece piece;
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(piece, a) = off[a];
    for (int j = GBT_DIMENSION; j < GBT_FLAT; j++) piece[0][j] = gbt_remainder(piece[0][j], GBT_TURN);
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < pieces; i++) {
        gbt_settle(piece, 0, rest);
        for (int j = 0; j < GBT_FLAT; j++) top[i * GBT_FREE + j] += *gbt_free(piece, j);
        gbt_next_piece(piece, piece);
    }
}

void gbt_coast(const gbt_real *start, gbt_real aside, gbt_real *top)
{
    gbt_piece piece;
    gbt_real aim[GBT_FLAT];
    for (int j = 0; j < GBT_FLAT; j++) aim[j] = aside / gbt_sqrt((gbt_real)(j + 1)) * gbt_acceleration_scale[j];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_settle(piece, 2, aim);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, piece);
    }
}

/* Held at the beginning of each piece; within it the acceleration is. */
void gbt_press(const gbt_real *start, const gbt_real *share, gbt_real *top)
{
    gbt_real thrust[GBT_INPUTS], aim[GBT_FLAT];
    gbt_piece piece;
    for (int j = 0; j < GBT_INPUTS; j++)
        thrust[j] = share[j] < 0 ? -share[j] * gbt_thrust_min[j] : share[j] * gbt_thrust_max[j];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_vehicle_acceleration(piece[0], piece[1], thrust, aim);
        gbt_settle(piece, 2, aim);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, piece);
    }
}

/* It coasts. */
void gbt_lengthen(const gbt_real *last, gbt_real *added)
{
    (void)last;
    for (int a = 0; a < GBT_FREE; a++) added[a] = 0;
}
