/* Newton's step of a trajectory by integration, by a Riccati recursion over its pieces, and the trial along it.

   With the second derivatives of the dynamics times their multipliers the recursion gives Newton's step of the problem in
   the inputs alone, exactly, at a cost linear in the pieces. Where that is no descent, the step is that of Gauss and Newton:
   without these second derivatives, which grow with the horizon where a vehicle is unstable, and regularised where the
   objective, which reads positions, is curved the wrong way. */
#include "gbt_form.h"

#include "gbt_math.h"

#define PLACE ((gbt_real)100) /* regularisation of a position in m over that of an input over its limit */

/* Where the dynamics do not depend on the place, the state at the end moves with the position at the beginning. */
#define MOVED_ALONG (GBT_RELATIVE ? GBT_DIMENSION : 0)

void gbt_add_rest(gbt_real slopes[GBT_STATE][GBT_PIECE], gbt_real rest[GBT_STATE][GBT_STATE],
                  gbt_real h[GBT_PIECE][GBT_PIECE])
{
    gbt_real product[GBT_STATE][GBT_PIECE];
    for (int r = 0; r < GBT_STATE; r++) {
        gbt_real row[GBT_PIECE];
        for (int a = 0; a < GBT_PIECE; a++) row[a] = a < MOVED_ALONG ? rest[r][a] : 0;
        for (int k = 0; k < GBT_STATE; k++)
            for (int a = MOVED_ALONG; a < GBT_PIECE; a++) row[a] += rest[r][k] * slopes[k][a];
        for (int a = 0; a < GBT_PIECE; a++) product[r][a] = row[a];
    }
    for (int a = 0; a < MOVED_ALONG; a++)
        for (int c = 0; c < GBT_STATE; c++) h[a][c] += product[a][c];
    for (int a = MOVED_ALONG; a < GBT_STATE; a++) {
        gbt_real row[GBT_STATE];
        for (int c = 0; c < GBT_STATE; c++) row[c] = h[a][c];
        for (int r = 0; r < GBT_STATE; r++)
            for (int c = 0; c < GBT_STATE; c++) row[c] += slopes[r][a] * product[r][c];
        for (int c = 0; c < GBT_STATE; c++) h[a][c] = row[c];
    }
    for (int a = GBT_STATE; a < GBT_PIECE; a++) {
        gbt_real row[GBT_PIECE];
        for (int c = 0; c < GBT_PIECE; c++) row[c] = h[a][c];
        for (int r = 0; r < GBT_STATE; r++)
            for (int c = 0; c < GBT_PIECE; c++) row[c] += slopes[r][a] * product[r][c];
        for (int c = 0; c < GBT_PIECE; c++) h[a][c] = row[c];
    }
}

static void begin_rest(const gbt_workspace *work, gbt_real rest[GBT_STATE][GBT_STATE])
{
    for (int a = 0; a < GBT_STATE; a++)
        for (int c = 0; c <= a; c++) rest[a][c] = rest[c][a] = work->curvature[work->pieces][a][c];
}

/* Quadratic model from piece i on. */
static void add_piece(gbt_workspace *work, int i, gbt_real delta, gbt_real rest[GBT_STATE][GBT_STATE],
                      gbt_real h[GBT_PIECE][GBT_PIECE])
{
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c <= a; c++) h[a][c] = h[c][a] = work->curvature[i][a][c];
    for (int a = 0; a < gbt_stage_entries && delta <= 0; a++) {
        const int row = gbt_stage_row[a], column = gbt_stage_column[a];
        h[row][column] += work->bend[i][a];
        h[column][row] = h[row][column];
    }
    for (int a = 0; a < GBT_FREE; a++)
        h[GBT_STATE + a][GBT_STATE + a] += delta / (gbt_input_scale[a] * gbt_input_scale[a]);
    for (int a = 0; a < GBT_DIMENSION && delta > 0; a++) rest[a][a] += PLACE * delta;
    gbt_add_rest(work->slopes[i], rest, h);
}

#if GBT_SUMS /* the recursion is that of gbt_coupling.c */
void gbt_end_model(const gbt_workspace *work, gbt_real rest[GBT_STATE][GBT_STATE]) { begin_rest(work, rest); }

void gbt_piece_model(gbt_workspace *work, int i, gbt_real delta, gbt_real rest[GBT_STATE][GBT_STATE],
                     gbt_real h[GBT_PIECE][GBT_PIECE])
{
    add_piece(work, i, delta, rest, h);
    for (int a = 0; a < GBT_STATE; a++)
        for (int c = GBT_STATE; c < GBT_PIECE; c++) h[a][c] = h[c][a];
}

void gbt_end_slopes(const gbt_workspace *work, int i, gbt_real slopes[GBT_STATE][GBT_PIECE])
{
    for (int r = 0; r < GBT_STATE; r++)
        for (int a = 0; a < GBT_PIECE; a++) slopes[r][a] = work->slopes[i][r][a];
}
#else
int gbt_factorise(gbt_workspace *work, gbt_real delta)
{
    gbt_real rest[GBT_STATE][GBT_STATE], h[GBT_PIECE][GBT_PIECE];
    begin_rest(work, rest);
    for (int i = work->pieces - 1; i >= 0; i--) {
        add_piece(work, i, delta, rest, h);
        if (!gbt_eliminate_free(h, work->factor[i], work->gain[i], rest)) return 0;
    }
    return 1;
}
#endif

/* The change of the inputs of a piece for a part alpha of the step where its state has changed by so much. */
static void follow(gbt_workspace *work, int i, gbt_real alpha, const gbt_real *state, gbt_real *inputs)
{
    for (int a = 0; a < GBT_FREE; a++) {
        inputs[a] = alpha * work->push[i][a];
        for (int c = 0; c < GBT_STATE; c++) inputs[a] -= work->gain[i][a][c] * state[c];
    }
    gbt_backward(work->factor[i], inputs);
}

void gbt_follow_gains(gbt_workspace *work, int i, gbt_real part, const gbt_real *state, gbt_real *inputs)
{
    gbt_real change[GBT_STATE];
    for (int a = 0; a < GBT_STATE; a++) change[a] = state[a] - work->piece[i][a];
    follow(work, i, part, change, inputs);
    for (int a = 0; a < GBT_FREE; a++) inputs[a] += work->piece[i][GBT_STATE + a];
}

#if !GBT_SUMS
void gbt_step_along(gbt_workspace *work)
{
    for (int i = 0; i < work->pieces; i++) {
        gbt_real *step = work->step[i], *next = work->step[i + 1];
        follow(work, i, 1, step, step + GBT_STATE);
        for (int r = 0; r < GBT_STATE; r++) {
            next[r] = 0;
            for (int a = 0; a < GBT_PIECE; a++) next[r] += work->slopes[i][r][a] * step[a];
        }
    }
    for (int a = 0; a < GBT_FREE; a++) work->step[work->pieces][GBT_STATE + a] = 0;
}

/* The same for a start that is elsewhere by so much. */
void gbt_step_from(gbt_workspace *work, gbt_piece gradient[], const gbt_real *change)
{
    for (int i = work->pieces - 1; i >= 0; i--) {
        gbt_real *push = work->push[i], *next = gradient[i + 1], own[GBT_PIECE];
        for (int a = 0; a < GBT_PIECE; a++) own[a] = gradient[i][a];
        for (int r = 0; r < GBT_STATE; r++)
            for (int a = 0; a < GBT_PIECE; a++) own[a] += work->slopes[i][r][a] * next[r];
        for (int a = 0; a < GBT_FREE; a++) push[a] = -own[GBT_STATE + a];
        gbt_forward(work->factor[i], push);
        for (int k = 0; k < GBT_FREE; k++)
            for (int c = 0; c < GBT_STATE; c++) own[c] += work->gain[i][k][c] * push[k];
        for (int a = 0; a < GBT_STATE; a++) gradient[i][a] = own[a];
    }
    for (int a = 0; a < GBT_STATE; a++) work->step[0][a] = change[a];
    gbt_step_along(work);
}

#endif

void gbt_newton_step(gbt_workspace *work, gbt_piece gradient[])
{
    static const gbt_real nothing[GBT_STATE];
    gbt_step_from(work, gradient, nothing);
}

/* The inputs change with the state as the step does, along the trajectory that they really lead to. */
void gbt_try(gbt_workspace *work, gbt_real alpha)
{
    for (int a = 0; a < GBT_STATE; a++) work->trial[0][a] = work->piece[0][a];
    for (int i = 0; i < work->pieces; i++) {
        const gbt_real *piece = work->piece[i];
        gbt_real *trial = work->trial[i], change[GBT_STATE], inputs[GBT_FREE];
        for (int a = 0; a < GBT_STATE; a++) change[a] = trial[a] - piece[a];
        follow(work, i, alpha, change, inputs);
        for (int a = 0; a < GBT_FREE; a++) trial[GBT_STATE + a] = piece[GBT_STATE + a] + inputs[a];
        gbt_stage(trial, 0, 0, work->trial[i + 1]);
    }
    for (int a = 0; a < GBT_FREE; a++) work->trial[work->pieces][GBT_STATE + a] = 0;
}
