/* Trajectories by integration that no solver made: where one begins, what is left of one, and the last resort. */
#include "gbt_form.h"

#include "gbt_math.h"

void gbt_coast(const gbt_real *start, gbt_real aside, gbt_real *top)
{
    (void)start;
    for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) {
        const int j = k % GBT_INPUTS;
        top[k] = gbt_idle[j] + aside / gbt_sqrt((gbt_real)(j + 1)) * gbt_thrust_max[j];
    }
}

void gbt_press(const gbt_real *start, const gbt_real *share, gbt_real *top)
{
    (void)start;
    for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) {
        const int j = k % GBT_INPUTS;
        top[k] = share[j] < 0 ? -share[j] * gbt_thrust_min[j] : share[j] * gbt_thrust_max[j];
    }
}

/* The inputs are those of the rest: what they lead back differs from vehicle to vehicle. */
void gbt_lead_back(const gbt_real *off, int pieces, gbt_real *top)
{
    (void)off;
    (void)pieces;
    (void)top;
}

/* The inputs stay as they are at the end. */
void gbt_lengthen(const gbt_real *last, gbt_real *added)
{
    for (int a = 0; a < GBT_FREE; a++) added[a] = last[GBT_FREE - GBT_INPUTS + a % GBT_INPUTS];
}

void gbt_admit(gbt_piece piece)
{
    for (int a = 0; a < GBT_FREE; a++) {
        const int j = a % GBT_INPUTS;
        gbt_real *input = gbt_free(piece, a);
#if GBT_LAST < GBT_STATES
        const gbt_real before = piece[GBT_LAST + j], most = gbt_input_step[j];
        *input = *input > before + most ? before + most : *input < before - most ? before - most : *input;
#endif
        *input = *input > gbt_thrust_max[j] ? gbt_thrust_max[j] : *input < gbt_thrust_min[j] ? gbt_thrust_min[j] : *input;
    }
}

/* The inputs are what is planned: they keep within their limits between the nodes where they do at these. */
int gbt_mend(const gbt_real *start, gbt_real *top)
{
    (void)start;
    (void)top;
    return 0;
}

void gbt_brake(const gbt_real *start, gbt_real *top)
{
    gbt_piece piece;
    gbt_real inputs[GBT_INPUTS];
    for (int a = 0; a < GBT_STATE; a++) piece[a] = start[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
        gbt_last_resort(piece, 0, 0, inputs);
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = inputs[a % GBT_INPUTS];
        gbt_admit(piece);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, piece);
    }
}
