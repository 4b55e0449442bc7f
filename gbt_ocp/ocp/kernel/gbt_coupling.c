#include "gbt_coupling.h"

#include "gbt_form.h"
#include "gbt_math.h"

#if !GBT_SUMS
gbt_real gbt_gain(const gbt_real *total) { return total[0]; }

void gbt_value_sums(gbt_workspace *work) { work->worth[0] = 1; }
#else

#define SUMS GBT_SUMS
#define COLUMNS GBT_SUM_COLUMNS

gbt_real gbt_gain(const gbt_real *total)
{
    gbt_real gain;
    gbt_of_sums.value(total + 1, 0, 0, &gain);
    return total[0] + gain;
}

void gbt_value_sums(gbt_workspace *work)
{
    gbt_real total[GBT_TERMS], point[GBT_POINT];
    gbt_total(work, work->piece, total);
    work->worth[0] = 1;
    gbt_of_sums.gradient(total + 1, 0, 0, work->worth + 1);
    gbt_of_sums.hessian(total + 1, 0, 0, &work->bond[0][0]);
    for (int a = 0; a < SUMS; a++)
        for (int c = 0; c < SUMS; c++) work->bond[a][c] = -work->bond[a][c];
    for (int i = 0; i < work->pieces; i++) {
        gbt_end_point(work, i, point);
        gbt_of_sums.slopes(point, work->parameters + i * GBT_END_NUMBERS, 0, &work->sum_slopes[i][0][0]);
    }
}

/* The model of what comes after a piece: a quadratic in the state at its end, in the sums before it, and across. */
typedef struct {
    gbt_real states[GBT_STATE][GBT_STATE], cross[GBT_STATE][SUMS], sums[SUMS][SUMS];
} model;

/* The sums after the end of a piece are those before it and what they gain there, linear in the state: as a model in the
   sums before it. */
static void gain_at_end(const gbt_real (*slopes)[SUMS], model *rest)
{
    gbt_real product[COLUMNS][SUMS];
    for (int b = 0; b < COLUMNS; b++)
        for (int a = 0; a < SUMS; a++) {
            gbt_real value = 0;
            for (int k = 0; k < SUMS; k++) value += rest->sums[a][k] * slopes[b][k];
            product[b][a] = value;
        }
    for (int b = 0; b < COLUMNS; b++) {
        const int column = gbt_of_sums.column[b];
        for (int r = 0; r < GBT_STATE; r++) {
            gbt_real value = 0;
            for (int k = 0; k < SUMS; k++) value += rest->cross[r][k] * slopes[b][k];
            rest->states[r][column] += value;
            rest->states[column][r] += value;
        }
    }
    for (int b = 0; b < COLUMNS; b++)
        for (int c = 0; c < COLUMNS; c++) {
            gbt_real value = 0;
            for (int k = 0; k < SUMS; k++) value += slopes[b][k] * product[c][k];
            rest->states[gbt_of_sums.column[b]][gbt_of_sums.column[c]] += value;
        }
    for (int b = 0; b < COLUMNS; b++)
        for (int a = 0; a < SUMS; a++) rest->cross[gbt_of_sums.column[b]][a] += product[b][a];
}

/* across += slopes' cross */
static void carry(gbt_real slopes[GBT_STATE][GBT_PIECE], gbt_real cross[GBT_STATE][SUMS],
                  gbt_real across[GBT_PIECE][SUMS])
{
    for (int c = 0; c < GBT_PIECE; c++)
        for (int k = 0; k < SUMS; k++) across[c][k] = 0;
    for (int r = 0; r < GBT_STATE; r++)
        for (int c = 0; c < GBT_PIECE; c++) {
            if (slopes[r][c] == 0) continue; /* most are, where the trajectory is flat */
            for (int k = 0; k < SUMS; k++) across[c][k] += slopes[r][c] * cross[r][k];
        }
}

int gbt_factorise(gbt_workspace *work, gbt_real delta)
{
    gbt_real h[GBT_PIECE][GBT_PIECE], across[GBT_PIECE][SUMS], slopes[GBT_STATE][GBT_PIECE];
    model rest;
    gbt_end_model(work, rest.states);
    for (int a = 0; a < SUMS; a++)
        for (int c = 0; c < SUMS; c++) rest.sums[a][c] = work->bond[a][c];
    for (int r = 0; r < GBT_STATE; r++)
        for (int k = 0; k < SUMS; k++) rest.cross[r][k] = 0;
    for (int i = work->pieces - 1; i >= 0; i--) {
        gbt_real(*factor)[GBT_FREE] = work->factor[i], (*gain)[GBT_STATE] = work->gain[i];
        gbt_real(*sum_gain)[SUMS] = work->sum_gain[i];
        gain_at_end((const gbt_real(*)[SUMS])work->sum_slopes[i], &rest);
        gbt_piece_model(work, i, delta, rest.states, h);
        gbt_end_slopes(work, i, slopes);
        carry(slopes, rest.cross, across);

        if (!gbt_eliminate_free(h, factor, gain, rest.states)) return 0;
        for (int a = 0; a < GBT_FREE; a++) {
            for (int c = 0; c < SUMS; c++) sum_gain[a][c] = across[GBT_STATE + a][c];
            for (int k = 0; k < a; k++)
                for (int c = 0; c < SUMS; c++) sum_gain[a][c] -= factor[k][a] * sum_gain[k][c];
            for (int c = 0; c < SUMS; c++) sum_gain[a][c] *= factor[a][a];
        }

        /* The model of the rest as a function of state and sums. */
        for (int a = 0; a < GBT_STATE; a++) {
            for (int c = 0; c < SUMS; c++) rest.cross[a][c] = across[a][c];
            for (int k = 0; k < GBT_FREE; k++)
                for (int c = 0; c < SUMS; c++) rest.cross[a][c] -= gain[k][a] * sum_gain[k][c];
        }
        for (int a = 0; a < SUMS; a++)
            for (int k = 0; k < GBT_FREE; k++)
                for (int c = 0; c < SUMS; c++) rest.sums[a][c] -= sum_gain[k][a] * sum_gain[k][c];
    }
    return 1;
}

/* Newton's step for a start that is elsewhere by so much: the change of the sums is left in work->push. */
static void step_from(gbt_workspace *work, gbt_piece gradient[], const gbt_real *change)
{
    gbt_real slopes[GBT_STATE][GBT_PIECE], state[GBT_STATE], sums[SUMS];
    for (int k = 0; k < SUMS; k++) sums[k] = 0;
    for (int r = 0; r < GBT_STATE; r++) state[r] = 0;
#if GBT_SHOOTING
    for (int r = 0; r < GBT_STATE; r++) state[r] = gradient[work->pieces][r];
#endif
    for (int i = work->pieces - 1; i >= 0; i--) { /* the slopes by state and sums at the end of the piece */
        gbt_real *push = work->push[i], own[GBT_PIECE];
        const gbt_real *numbers = (const gbt_real *)gradient[i];
        for (int b = 0; b < COLUMNS; b++)
            for (int k = 0; k < SUMS; k++) state[gbt_of_sums.column[b]] += work->sum_slopes[i][b][k] * sums[k];
        gbt_end_slopes(work, i, slopes);
        for (int a = 0; a < GBT_PIECE; a++) own[a] = numbers[a];
        for (int r = 0; r < GBT_STATE; r++)
            for (int a = 0; a < GBT_PIECE; a++) own[a] += slopes[r][a] * state[r];
        for (int a = 0; a < GBT_FREE; a++) push[a] = -own[GBT_STATE + a];
        gbt_forward(work->factor[i], push);
        for (int r = 0; r < GBT_STATE; r++) {
            state[r] = own[r];
            for (int a = 0; a < GBT_FREE; a++) state[r] += work->gain[i][a][r] * push[a];
        }
        for (int a = 0; a < GBT_FREE; a++)
            for (int k = 0; k < SUMS; k++) sums[k] += work->sum_gain[i][a][k] * push[a];
    }
    for (int k = 0; k < SUMS; k++) sums[k] = 0;
    for (int r = 0; r < GBT_STATE; r++) state[r] = change[r];
    for (int i = 0; i < work->pieces; i++) {
        gbt_real *push = work->push[i], *step = (gbt_real *)work->step[i];
        for (int a = 0; a < GBT_FREE; a++) {
            for (int k = 0; k < SUMS; k++) push[a] -= work->sum_gain[i][a][k] * sums[k];
            step[GBT_STATE + a] = push[a];
            for (int r = 0; r < GBT_STATE; r++) step[GBT_STATE + a] -= work->gain[i][a][r] * state[r];
        }
        gbt_backward(work->factor[i], step + GBT_STATE);
        for (int r = 0; r < GBT_STATE; r++) step[r] = state[r];
        gbt_end_slopes(work, i, slopes);
        for (int r = 0; r < GBT_STATE; r++) {
            state[r] = 0;
            for (int a = 0; a < GBT_PIECE; a++) state[r] += slopes[r][a] * step[a];
        }
        for (int b = 0; b < COLUMNS; b++)
            for (int k = 0; k < SUMS; k++) sums[k] += work->sum_slopes[i][b][k] * state[gbt_of_sums.column[b]];
    }
#if GBT_SHOOTING
    for (int r = 0; r < GBT_STATE; r++) work->step[work->pieces][r] = state[r];
    for (int a = 0; a < GBT_FREE; a++) work->step[work->pieces][GBT_STATE + a] = 0;
#endif
}

#if GBT_SHOOTING
void gbt_step_from(gbt_workspace *work, gbt_piece gradient[], const gbt_real *change)
{
    step_from(work, gradient, change);
}
#else
void gbt_newton_step(gbt_workspace *work, gbt_piece gradient[])
{
    static const gbt_real nothing[GBT_STATE];
    step_from(work, gradient, nothing);
}
#endif
#endif
