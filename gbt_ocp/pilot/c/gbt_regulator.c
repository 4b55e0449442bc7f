#include "gbt_regulator.h"

#include "gbt_form.h"
#include "gbt_math.h"
#include "gbt_thrust.h"

#if GBT_SHOOTING

#define N GBT_LAST
#define M GBT_INPUTS
#define TURN ((gbt_real)6.283185307179586)

/* Solves the equations of M x M, spoilt, for N right sides, which become the solutions. */
static void solve(gbt_real matrix[M][M], gbt_real right[M][N])
{
    for (int k = 0; k < M; k++) {
        int best = k;
        for (int r = k + 1; r < M; r++)
            if (gbt_fabs(matrix[r][k]) > gbt_fabs(matrix[best][k])) best = r;
        for (int c = 0; c < M; c++) {
            const gbt_real kept = matrix[k][c];
            matrix[k][c] = matrix[best][c];
            matrix[best][c] = kept;
        }
        for (int c = 0; c < N; c++) {
            const gbt_real kept = right[k][c];
            right[k][c] = right[best][c];
            right[best][c] = kept;
        }
        for (int r = k + 1; r < M; r++) {
            const gbt_real part = matrix[r][k] / matrix[k][k];
            for (int c = k; c < M; c++) matrix[r][c] -= part * matrix[k][c];
            for (int c = 0; c < N; c++) right[r][c] -= part * right[k][c];
        }
    }
    for (int k = M - 1; k >= 0; k--)
        for (int c = 0; c < N; c++) {
            for (int r = k + 1; r < M; r++) right[k][c] -= matrix[k][r] * right[r][c];
            right[k][c] /= matrix[k][k];
        }
}

typedef struct {
    gbt_real after[N], state[N][N], inputs[N][M]; /* in the order of gbt_grid_slopes */
} slopes;

static void slopes_at(const gbt_regulator *regulator, int k, slopes *at)
{
    gbt_real out[N + N * N + N * M], *next = out;
    gbt_grid_slopes(regulator->state[k], regulator->inputs[k], 0, out);
    for (int a = 0; a < N; a++) at->after[a] = *next++;
    for (int a = 0; a < N; a++)
        for (int c = 0; c < N; c++) at->state[a][c] = *next++;
    for (int a = 0; a < N; a++)
        for (int c = 0; c < M; c++) at->inputs[a][c] = *next++;
}

/* The inputs in the middle of each part of the grid, and where they lead. */
static void lay_out(gbt_regulator *regulator, const gbt_real *start, gbt_real top[GBT_PIECES][GBT_FREE])
{
    const gbt_real none = 0, all = 1;
    gbt_piece piece;
    slopes at;
    for (int a = 0; a < GBT_STATE; a++) piece[a] = start[a];
    for (int a = 0; a < N; a++) regulator->state[0][a] = start[a];
    for (int i = 0; i < GBT_REACHED; i++) {
        gbt_real first[M], last[M];
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = top[i][a];
        gbt_stage_inputs(piece, &none, 0, first);
        gbt_stage_inputs(piece, &all, 0, last);
        for (int part = 0; part < GBT_PARTS; part++) {
            const gbt_real share = ((gbt_real)part + (gbt_real)0.5) / (gbt_real)GBT_PARTS;
            const int k = i * GBT_PARTS + part;
            for (int j = 0; j < M; j++) regulator->inputs[k][j] = (1 - share) * first[j] + share * last[j];
            slopes_at(regulator, k, &at);
            for (int a = 0; a < N; a++) regulator->state[k + 1][a] = at.after[a];
        }
#if GBT_LAST < GBT_STATES
        for (int j = 0; j < M; j++) piece[GBT_LAST + j] = last[j];
#endif
    }
}

/* Backwards along the grid: the gain of each part, and what is left of the deviations before it, rest. */
static void regulate(gbt_regulator *regulator)
{
    const gbt_real *weight = gbt_pilot_numbers.regulator_weight, spacing = GBT_PERIOD / (gbt_real)GBT_PARTS;
    gbt_real rest[N][N];
    for (int a = 0; a < N; a++)
        for (int c = 0; c < N; c++) rest[a][c] = a == c ? weight[a] / spacing : 0;
    for (int k = GBT_GRID - 1; k >= 0; k--) {
        slopes at;
        gbt_real pushed[M][N], effort[M][M], closed[N][N], product[N][N];
        slopes_at(regulator, k, &at);
        for (int j = 0; j < M; j++)
            for (int c = 0; c < N; c++) {
                pushed[j][c] = 0;
                for (int a = 0; a < N; a++) pushed[j][c] += at.inputs[a][j] * rest[a][c];
            }
        for (int j = 0; j < M; j++) {
            for (int i = 0; i < M; i++) {
                effort[j][i] = i == j ? 1 / (gbt_thrust_max[j] * gbt_thrust_max[j]) : 0;
                for (int a = 0; a < N; a++) effort[j][i] += pushed[j][a] * at.inputs[a][i];
            }
            for (int c = 0; c < N; c++) {
                regulator->gain[k][j][c] = 0;
                for (int a = 0; a < N; a++) regulator->gain[k][j][c] += pushed[j][a] * at.state[a][c];
            }
        }
        solve(effort, regulator->gain[k]);
        for (int a = 0; a < N; a++)
            for (int c = 0; c < N; c++) {
                closed[a][c] = at.state[a][c];
                for (int j = 0; j < M; j++) closed[a][c] -= at.inputs[a][j] * regulator->gain[k][j][c];
            }
        for (int a = 0; a < N; a++)
            for (int c = 0; c < N; c++) {
                product[a][c] = 0;
                for (int b = 0; b < N; b++) product[a][c] += rest[a][b] * closed[b][c];
            }
        for (int a = 0; a < N; a++)
            for (int c = 0; c < N; c++) {
                rest[a][c] = a == c ? weight[a] : 0;
                for (int b = 0; b < N; b++) rest[a][c] += at.state[b][a] * product[b][c];
            }
    }
}

void gbt_regulator_replace(gbt_regulator *regulator, const gbt_real *start, gbt_real top[GBT_PIECES][GBT_FREE])
{
    lay_out(regulator, start, top);
    regulate(regulator);
    regulator->planned = 1;
}

void gbt_regulator_plan(gbt_regulator *regulator, const gbt_real *start, gbt_real top[GBT_PIECES][GBT_FREE])
{
    gbt_regulator_replace(regulator, start, top);
    /* a plan that begins where the last one is gives inputs that go on from it */
    regulator->given_at = fmin(0, regulator->given_at - (double)GBT_PERIOD);
}

void gbt_regulator_inputs(gbt_regulator *regulator, double now, const gbt_real *z, const gbt_real *dz, gbt_real *inputs)
{
    const double place = fmin(fmax(now / ((double)GBT_PERIOD / GBT_PARTS), 0), (double)GBT_GRID);
    const int least = (int)(place + 1e-9), before = least < GBT_GRID - 1 ? least : GBT_GRID - 1;
    const gbt_real part = (gbt_real)(place - before);
    gbt_real own[N], error[N];
    gbt_driven_state(z, dz, 0, own);
    for (int a = 0; a < N; a++) {
        error[a] = (1 - part) * regulator->state[before][a] + part * regulator->state[before + 1][a] - own[a];
        if (a >= GBT_DIMENSION && a < GBT_FLAT) error[a] = gbt_remainder(error[a], TURN);
    }
    for (int j = 0; j < M; j++) {
        inputs[j] = regulator->inputs[before][j];
        for (int a = 0; a < N; a++) inputs[j] += regulator->gain[before][j][a] * error[a];
        inputs[j] = gbt_within_thrust(j, inputs[j], 1);
        if (regulator->given && regulator->given_at < now && gbt_pilot_numbers.input_rate[j] > 0) {
            const gbt_real most = (gbt_real)(now - regulator->given_at) * gbt_pilot_numbers.input_rate[j];
            const gbt_real low = regulator->last[j] - most, high = regulator->last[j] + most;
            inputs[j] = inputs[j] < low ? low : inputs[j] > high ? high : inputs[j];
        }
    }
    for (int j = 0; j < M; j++) regulator->last[j] = inputs[j];
    regulator->given = 1;
    regulator->given_at = now;
}

#endif
