/* Newton's step of the flat form by a Riccati recursion: the trajectory is a linear system (derivatives 0 .. L-1, driven
   by the L-th), so the quadratic model of the problem is a linear-quadratic one, and the cost of a step is linear in the
   pieces.

   The regularisation is added for every derivative that is joined, from the rate on, at the end of a piece, in units of
   what an input of one changes it by within the piece. (Added to the inputs themselves, a long horizon would need far
   more of it: all later rates change with an early input. Added to the rates alone, it would leave derivatives above them
   free to alternate from piece to piece.) */
#include "gbt_pieces.h"

#include "gbt_math.h"

static const gbt_real at_end[GBT_DERIVATIVES] = GBT_TAYLOR;

/* h = H + M' P M, where the next state is M times the numbers of the piece. */
static void add_rest(gbt_real rest[GBT_STATE][GBT_STATE], gbt_real own[GBT_PIECE][GBT_PIECE],
                     gbt_real h[GBT_PIECE][GBT_PIECE])
{
    gbt_real product[GBT_STATE][GBT_PIECE]; /* P M */
    for (int row = 0; row < GBT_STATE; row++)
        for (int l = 0; l < GBT_DERIVATIVES; l++)
            for (int j = 0; j < GBT_FLAT; j++) {
                gbt_real value = rest[row][j] * at_end[l];
                for (int o = 1; o < GBT_JOINED && o <= l; o++) value += rest[row][o * GBT_FLAT + j] * at_end[l - o];
                product[row][GBT_ROW(l) * GBT_FLAT + j] = value;
            }
#if GBT_REMEMBERED /* of the next piece it is the lowest free derivative of this one; that of this one ends with it */
    for (int row = 0; row < GBT_STATE; row++)
        for (int j = 0; j < GBT_FLAT; j++) {
            product[row][GBT_JOINED * GBT_FLAT + j] = 0;
            product[row][GBT_ROW(GBT_JOINED) * GBT_FLAT + j] += rest[row][GBT_JOINED * GBT_FLAT + j];
        }
    for (int j = 0; j < GBT_FLAT; j++)
        for (int c = 0; c < GBT_PIECE; c++)
            h[GBT_JOINED * GBT_FLAT + j][c] = own[GBT_JOINED * GBT_FLAT + j][c];
#endif
    for (int l = 0; l < GBT_DERIVATIVES; l++)
        for (int j = 0; j < GBT_FLAT; j++) {
            const int row = GBT_ROW(l) * GBT_FLAT + j;
            gbt_real *to = h[row];
            for (int c = 0; c < GBT_PIECE; c++) to[c] = own[row][c] + at_end[l] * product[j][c];
            for (int o = 1; o < GBT_JOINED && o <= l; o++)
                for (int c = 0; c < GBT_PIECE; c++) to[c] += at_end[l - o] * product[o * GBT_FLAT + j][c];
#if GBT_REMEMBERED
            for (int c = 0; c < GBT_PIECE && l == GBT_JOINED; c++) to[c] += product[GBT_JOINED * GBT_FLAT + j][c];
#endif
        }
}

/* What is added to the diagonals: of the model at the end of a piece, and of what is free in it. */
static void damp(gbt_real delta, gbt_real damping[GBT_PIECE])
{
    for (int a = 0; a < GBT_PIECE; a++) damping[a] = 0;
    gbt_real reach[GBT_FLAT]; /* what an input of one changes a derivative by within a piece */
    for (int j = 0; j < GBT_FLAT; j++) reach[j] = gbt_input_scale[j];
    for (int a = GBT_MOTION - 1; a >= GBT_FLAT && delta > 0; a--) {
        reach[a % GBT_FLAT] *= GBT_PERIOD;
        damping[a] = delta / (reach[a % GBT_FLAT] * reach[a % GBT_FLAT]);
    }
    /* what the derivatives at the end do not see */
    for (int a = GBT_FLAT; a < GBT_FREE; a++)
        damping[GBT_STATE + a] = delta / (gbt_input_scale[a] * gbt_input_scale[a]);
}

/* Quadratic model from piece i on. */
static void add_piece(gbt_workspace *work, int i, const gbt_real damping[GBT_PIECE],
                      gbt_real rest[GBT_STATE][GBT_STATE], gbt_real h[GBT_PIECE][GBT_PIECE])
{
    for (int a = GBT_FLAT; a < GBT_MOTION; a++) rest[a][a] += damping[a];
    add_rest(rest, work->curvature[i], h);
    for (int a = GBT_STATE + GBT_FLAT; a < GBT_PIECE; a++) h[a][a] += damping[a];
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
    gbt_real damping[GBT_PIECE];
    damp(delta, damping);
    add_piece(work, i, damping, rest, h);
}

void gbt_end_slopes(const gbt_workspace *work, int i, gbt_real slopes[GBT_STATE][GBT_PIECE])
{
    (void)work;
    (void)i;
    for (int a = 0; a < GBT_STATE; a++) {
        const int o = a / GBT_FLAT, j = a % GBT_FLAT;
        for (int c = 0; c < GBT_PIECE; c++) slopes[a][c] = 0;
        if (o == GBT_JOINED) slopes[a][GBT_ROW(GBT_JOINED) * GBT_FLAT + j] = 1;
        for (int k = 0; o < GBT_JOINED && o + k < GBT_DERIVATIVES; k++)
            slopes[a][GBT_ROW(o + k) * GBT_FLAT + j] = at_end[k];
    }
}
#else
int gbt_factorise(gbt_workspace *work, gbt_real delta)
{
    gbt_real rest[GBT_STATE][GBT_STATE], h[GBT_PIECE][GBT_PIECE], damping[GBT_PIECE];
    for (int a = 0; a < GBT_STATE; a++)
        for (int c = 0; c < GBT_STATE; c++) rest[a][c] = 0;
    damp(delta, damping);
    for (int i = work->pieces - 1; i >= 0; i--) {
        add_piece(work, i, damping, rest, h);
        if (!gbt_eliminate_free(h, work->factor[i], work->gain[i], rest)) return 0;
    }
    return 1;
}

void gbt_newton_step(gbt_workspace *work, gbt_piece gradient[])
{
    for (int i = work->pieces - 1; i >= 0; i--) {
        gbt_real *push = work->push[i];
        for (int a = 0; a < GBT_FREE; a++) push[a] = -*gbt_free(gradient[i], a);
        gbt_forward(work->factor[i], push);
        if (i == 0) continue;
        for (int o = 0; o < GBT_JOINED; o++)
            for (int j = 0; j < GBT_FLAT; j++) {
                gbt_real slope = gradient[i][o][j];
                for (int k = 0; k < GBT_FREE; k++) slope += work->gain[i][k][o * GBT_FLAT + j] * push[k];
                for (int k = 0; o + k < GBT_DERIVATIVES; k++) gradient[i - 1][GBT_ROW(o + k)][j] += at_end[k] * slope;
            }
#if GBT_REMEMBERED
        for (int j = 0; j < GBT_FLAT; j++) {
            gbt_real slope = gradient[i][GBT_JOINED][j];
            for (int k = 0; k < GBT_FREE; k++) slope += work->gain[i][k][GBT_JOINED * GBT_FLAT + j] * push[k];
            gradient[i - 1][GBT_ROW(GBT_JOINED)][j] += slope;
        }
#endif
    }
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(work->step[0], a) = 0;
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
