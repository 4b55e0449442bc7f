/* Newton's step of the flat form by a Riccati recursion: the trajectory is a linear system (derivatives 0 .. L-1, driven
   by the L-th), so the quadratic model of the problem is a linear-quadratic one, and the cost of a step is linear in the
   pieces.

   The regularisation is added for every derivative that is joined, from the rate on, at the end of a piece, in units of
   what an input of one changes it by within the piece. (Added to the inputs themselves, a long horizon would need far
   more of it: all later rates change with an early input. Added to the rates alone, it would leave derivatives above them
   free to alternate from piece to piece.) */
#include "gbt_pieces.h"

#include "gbt_math.h"

/* h += M' P M, where the next state is M times the numbers of the piece. */
static void add_rest(const gbt_real *power, gbt_real rest[GBT_STATE][GBT_STATE], gbt_real h[GBT_PIECE][GBT_PIECE])
{
    for (int row = 0; row < GBT_STATE; row++) {
        gbt_real product[GBT_PIECE]; /* this row of P M */
        for (int l = 0; l < GBT_ORDERS; l++)
            for (int j = 0; j < GBT_FLAT; j++) {
                gbt_real value = 0;
                for (int o = 0; o < GBT_JOINED && o <= l; o++) value += rest[row][o * GBT_FLAT + j] * power[l - o];
                product[l * GBT_FLAT + j] = value;
            }
        const gbt_real *factor = power;
        for (int a = row; a < GBT_PIECE; a += GBT_FLAT, factor++)
            for (int c = 0; c <= a; c++) h[a][c] += *factor * product[c];
    }
}

/* Quadratic model from piece i on, of which only the lower triangle is kept. */
static void add_piece(gbt_workspace *work, int i, const gbt_real *power, gbt_real delta,
                      gbt_real rest[GBT_STATE][GBT_STATE], gbt_real h[GBT_PIECE][GBT_PIECE])
{
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c <= a; c++) h[a][c] = work->curvature[i][a][c];
    for (int a = GBT_FLAT; a < GBT_STATE; a++) {
        const gbt_real unit =
            gbt_input_scale[a % GBT_FLAT] * gbt_pow(GBT_PERIOD, (gbt_real)(GBT_JOINED - a / GBT_FLAT));
        rest[a][a] += delta / (unit * unit);
    }
    /* what the derivatives at the end do not see */
    for (int a = GBT_FLAT; a < GBT_FREE; a++)
        h[GBT_STATE + a][GBT_STATE + a] += delta / (gbt_input_scale[a] * gbt_input_scale[a]);
    add_rest(power, rest, h);
}

#if GBT_SUMS /* the recursion is that of gbt_coupling.c */
void gbt_end_model(const gbt_workspace *work, gbt_real rest[GBT_STATE][GBT_STATE])
{
    (void)work;
    for (int a = 0; a < GBT_STATE; a++)
        for (int c = 0; c < GBT_STATE; c++) rest[a][c] = 0;
}

void gbt_piece_model(gbt_workspace *work, int i, gbt_real delta, gbt_real rest[GBT_STATE][GBT_STATE],
                     gbt_real h[GBT_PIECE][GBT_PIECE])
{
    gbt_real power[GBT_ORDERS];
    gbt_taylor(GBT_PERIOD, power);
    add_piece(work, i, power, delta, rest, h);
}

void gbt_end_slopes(const gbt_workspace *work, int i, gbt_real slopes[GBT_STATE][GBT_PIECE])
{
    gbt_real power[GBT_ORDERS];
    (void)work;
    (void)i;
    gbt_taylor(GBT_PERIOD, power);
    for (int a = 0; a < GBT_STATE; a++) {
        for (int c = 0; c < GBT_PIECE; c++) slopes[a][c] = 0;
        for (int k = 0; a + k * GBT_FLAT < GBT_PIECE; k++) slopes[a][a + k * GBT_FLAT] = power[k];
    }
}
#else
int gbt_factorise(gbt_workspace *work, gbt_real delta)
{
    gbt_real power[GBT_ORDERS], rest[GBT_STATE][GBT_STATE], h[GBT_PIECE][GBT_PIECE];
    gbt_taylor(GBT_PERIOD, power);
    for (int i = work->pieces - 1; i >= 0; i--) {
        for (int a = 0; a < GBT_STATE && i == work->pieces - 1; a++)
            for (int c = 0; c < GBT_STATE; c++) rest[a][c] = 0;
        add_piece(work, i, power, delta, rest, h);

        /* Cholesky factor of its part in what is free. */
        gbt_real(*factor)[GBT_FREE] = work->factor[i];
        for (int a = 0; a < GBT_FREE; a++) {
            const gbt_real natural = gbt_fabs(h[GBT_STATE + a][GBT_STATE + a]);
            for (int c = 0; c <= a; c++) {
                gbt_real value = h[GBT_STATE + a][GBT_STATE + c];
                for (int k = 0; k < c; k++) value -= factor[a][k] * factor[c][k];
                if (c < a)
                    factor[a][c] = value / factor[c][c];
                else if (value > 10 * GBT_EPSILON * natural)
                    factor[a][a] = gbt_sqrt(value);
                else
                    return 0; /* also where value is NaN */
            }
        }

        /* Eliminate it: the gain, and the model of the rest as a function of the state. */
        for (int c = 0; c < GBT_STATE; c++) {
            gbt_real column[GBT_FREE];
            for (int a = 0; a < GBT_FREE; a++) column[a] = h[GBT_STATE + a][c];
            gbt_forward(factor, column);
            for (int a = 0; a < GBT_FREE; a++) work->gain[i][a][c] = column[a];
        }
        for (int a = 0; a < GBT_STATE; a++)
            for (int c = 0; c <= a; c++) {
                gbt_real value = h[a][c];
                for (int k = 0; k < GBT_FREE; k++) value -= work->gain[i][k][a] * work->gain[i][k][c];
                rest[a][c] = rest[c][a] = value;
            }
    }
    return 1;
}

void gbt_newton_step(gbt_workspace *work, gbt_piece gradient[])
{
    gbt_real power[GBT_ORDERS];
    gbt_taylor(GBT_PERIOD, power);
    for (int i = work->pieces - 1; i >= 0; i--) {
        gbt_real *push = work->push[i];
        for (int a = 0; a < GBT_FREE; a++) push[a] = -*gbt_free(gradient[i], a);
        gbt_forward(work->factor[i], push);
        if (i == 0) continue;
        for (int o = 0; o < GBT_JOINED; o++)
            for (int j = 0; j < GBT_FLAT; j++) {
                gbt_real slope = gradient[i][o][j];
                for (int k = 0; k < GBT_FREE; k++) slope += work->gain[i][k][o * GBT_FLAT + j] * push[k];
                for (int k = 0; o + k < GBT_ORDERS; k++) gradient[i - 1][o + k][j] += power[k] * slope;
            }
    }
    for (int o = 0; o < GBT_JOINED; o++)
        for (int j = 0; j < GBT_FLAT; j++) work->step[0][o][j] = 0;
    for (int i = 0; i < work->pieces; i++) {
        gbt_real free[GBT_FREE];
        for (int a = 0; a < GBT_FREE; a++) {
            free[a] = work->push[i][a];
            for (int c = 0; c < GBT_STATE; c++)
                free[a] -= work->gain[i][a][c] * work->step[i][c / GBT_FLAT][c % GBT_FLAT];
        }
        gbt_backward(work->factor[i], free);
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(work->step[i], a) = free[a];
        if (i + 1 < work->pieces) gbt_next_piece(work->step[i], work->step[i + 1]);
    }
}
#endif
