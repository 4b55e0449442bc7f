/* Checks of the kernel's inner functions, compiled together with it and called from test_kernel.py. */
#include <math.h>
#include <stdlib.h>

#include "gbt_pieces.h"
#include "gbt_slacks.h"

enum { N = GBT_PIECES * GBT_FREE };

int check_numbers(void) { return GBT_NUMBERS; }

static gbt_workspace work;

static double uniform(void) { return 2.0 * rand() / RAND_MAX - 1.0; }

/* Lagrangian f + lambda y at L-th derivatives x. */
static double lagrangian(const double *start, const double *x, const double *lambda)
{
    static double y[GBT_SIDES];
    for (int a = 0; a < GBT_STATE; a++) work.piece[0][a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < N; a++) *gbt_free(work.piece[a / GBT_FREE], a % GBT_FREE) = x[a];
    gbt_propagate(work.piece, GBT_PIECES);
    double sum = gbt_evaluate(&work, work.piece, y);
    for (int k = 0; k < GBT_COUNT; k++) sum += lambda[k] * y[k];
    return sum;
}

static void gradient(const double *start, const double *x, const double *lambda, double *out)
{
    static double pull[GBT_PIECES][GBT_ORDERS][GBT_FLAT];
    lagrangian(start, x, lambda);
    gbt_differentiate(&work);
    for (int a = 0; a < GBT_PIECES * GBT_PIECE; a++) (&pull[0][0][0])[a] = (&work.gradient[0][0][0])[a];
    gbt_pull_back(&work, lambda, pull);
    gbt_adjoint(&work, pull, (gbt_real(*)[GBT_FREE])out);
}

/* work.step as the change of the trajectory for a change dx of the L-th derivatives. */
static void spread(const double *dx)
{
    for (int a = 0; a < GBT_STATE; a++) work.step[0][a / GBT_FLAT][a % GBT_FLAT] = 0;
    for (int a = 0; a < N; a++) *gbt_free(work.step[a / GBT_FREE], a % GBT_FREE) = dx[a];
    gbt_propagate(work.step, GBT_PIECES);
}

/* What the sums gain to first order by a change of the trajectory, of which the ends of the pieces are given. */
static void gain_of_sums(double ends[GBT_PIECES][GBT_ORDERS][GBT_FLAT], double *out)
{
    (void)ends;
    (void)out;
#if GBT_SUMS
    for (int k = 0; k < GBT_SUMS; k++) out[k] = 0;
    for (int i = 0; i < GBT_PIECES; i++)
        for (int b = 0; b < GBT_SUM_COLUMNS; b++)
            for (int k = 0; k < GBT_SUMS; k++)
                out[k] += work.sum_slopes[i][b][k] * (&ends[i][0][0])[gbt_of_sums.column[b]];
#endif
}

static double bond(int a, int b)
{
#if GBT_SUMS
    return work.bond[a][b];
#else
    return a + b;
#endif
}

/* The Hessian with respect to all that is free, dense, from the ones of the pieces and that of the sums. */
static void dense(double delta, double h[N][N])
{
    static double change[N][GBT_PIECES][GBT_PIECE], ends[N][GBT_PIECES][GBT_ORDERS][GBT_FLAT], sums[N][GBT_TERMS];
    for (int a = 0; a < N; a++) {
        double dx[N] = {0};
        dx[a] = 1;
        spread(dx);
        for (int k = 0; k < GBT_PIECES * GBT_PIECE; k++) (&change[a][0][0])[k] = (&work.step[0][0][0])[k];
        for (int i = 0; i < GBT_PIECES; i++) {
            gbt_next_piece(work.step[i], ends[a][i]);
        }
        gain_of_sums(ends[a], sums[a]);
    }
    for (int a = 0; a < N; a++)
        for (int b = 0; b < N; b++) {
            h[a][b] = 0;
            for (int i = 0; i < GBT_PIECES; i++)
                for (int o = 1; o < GBT_JOINED; o++)
                    for (int j = 0; j < GBT_FLAT; j++) {
                        const double unit = gbt_input_scale[j] * pow(GBT_PERIOD, GBT_JOINED - o);
                        h[a][b] += delta / (unit * unit) * ends[a][i][o][j] * ends[b][i][o][j];
                    }
            /* what is free above the lowest order is damped by itself */
            if (a == b && a % GBT_FREE >= GBT_FLAT) {
                const double size = gbt_input_scale[a % GBT_FREE];
                h[a][b] += delta / (size * size);
            }
            for (int i = 0; i < GBT_PIECES; i++)
                for (int k = 0; k < GBT_PIECE; k++)
                    for (int l = 0; l < GBT_PIECE; l++)
                        h[a][b] += change[a][i][k] * work.curvature[i][k][l] * change[b][i][l];
            for (int k = 0; k < GBT_SUMS; k++)
                for (int l = 0; l < GBT_SUMS; l++) h[a][b] += sums[a][k] * bond(k, l) * sums[b][l];
        }
}

static void eliminate(double h[N][N], double *b)
{
    for (int k = 0; k < N; k++) {
        int pivot = k;
        for (int r = k + 1; r < N; r++)
            if (fabs(h[r][k]) > fabs(h[pivot][k])) pivot = r;
        for (int c = 0; c < N; c++) {
            const double keep = h[k][c];
            h[k][c] = h[pivot][c];
            h[pivot][c] = keep;
        }
        const double keep = b[k];
        b[k] = b[pivot];
        b[pivot] = keep;
        for (int r = k + 1; r < N; r++) {
            const double share = h[r][k] / h[k][k];
            for (int c = k; c < N; c++) h[r][c] -= share * h[k][c];
            b[r] -= share * b[k];
        }
    }
    for (int k = N - 1; k >= 0; k--) {
        for (int c = k + 1; c < N; c++) b[k] -= h[k][c] * b[c];
        b[k] /= h[k][k];
    }
}

static double start[GBT_STATE], x[N], lambda[GBT_SIDES];

static void draw(int seed, const double *parameters)
{
    srand((unsigned)seed);
    work.first = 0;
    work.pieces = GBT_PIECES;
    work.count = GBT_COUNT;
    work.parameters = parameters;
    work.moving = parameters + GBT_LIMIT_NUMBERS;
    for (int q = 0; q < GBT_LIMITS; q++) work.tightening[q] = 0;
    for (int a = 0; a < GBT_STATE; a++) start[a] = uniform();
    for (int a = 0; a < N; a++) x[a] = uniform() * gbt_input_scale[a % GBT_FREE];
    for (int k = 0; k < GBT_COUNT; k++) lambda[k] = 1 + uniform();
}

/* Largest relative difference of gradient and central difference of the Lagrangian. */
double check_gradient(int seed, const double *parameters)
{
    double g[N], worst = 0;
    draw(seed, parameters);
    gradient(start, x, lambda, g);
    for (int a = 0; a < N; a++) {
        const double step = 1e-5 * gbt_input_scale[a % GBT_FREE], at = x[a];
        x[a] = at + step;
        const double above = lagrangian(start, x, lambda);
        x[a] = at - step;
        const double difference = (above - lagrangian(start, x, lambda)) / (2 * step);
        x[a] = at;
        worst = fmax(worst, fabs(g[a] - difference) / (1 + fabs(g[a])));
    }
    return worst;
}

/* The same of Hessian and central difference of the gradient, with the squares of the Jacobian from its products. */
double check_hessian(int seed, const double *parameters)
{
    static double h[N][N], dys[N][GBT_SIDES], above[N], below[N];
    double worst = 0, largest = 0;
    draw(seed, parameters);
    gradient(start, x, lambda, above);
    for (int k = 0; k < GBT_COUNT; k++) {
        work.lambda[k] = lambda[k];
        work.sigma[k] = 1 + uniform();
    }
    gbt_assemble(&work);
    dense(0, h);
    for (int a = 0; a < N; a++) {
        double dx[N] = {0};
        dx[a] = 1;
        spread(dx);
        gbt_push_forward(&work);
        for (int k = 0; k < GBT_COUNT; k++) dys[a][k] = work.step_of.dy[k];
    }
    for (int a = 0; a < N; a++) {
        const double step = 1e-5 * gbt_input_scale[a % GBT_FREE], at = x[a];
        x[a] = at + step;
        gradient(start, x, lambda, above);
        x[a] = at - step;
        gradient(start, x, lambda, below);
        x[a] = at;
        for (int b = 0; b < N; b++) {
            double expected = (above[b] - below[b]) / (2 * step);
            for (int k = 0; k < GBT_COUNT; k++) expected += work.sigma[k] * dys[a][k] * dys[b][k];
            worst = fmax(worst, fabs(h[b][a] - expected));
            largest = fmax(largest, fabs(expected));
        }
    }
    return worst / largest;
}

/* Largest relative difference of the Riccati step and the dense one. */
double check_step(int seed, const double *parameters)
{
    static double h[N][N], g[N], pull[GBT_PIECES][GBT_ORDERS][GBT_FLAT];
    double delta = 1e-3, worst = 0, largest = 0;
    draw(seed, parameters);
    gradient(start, x, lambda, g);
    for (int k = 0; k < GBT_COUNT; k++) {
        work.lambda[k] = lambda[k];
        work.sigma[k] = exp(6 * uniform());
    }
    gbt_assemble(&work);
    while (!gbt_factorise(&work, delta)) delta *= 2;
    dense(delta, h);
    for (int a = 0; a < GBT_PIECES * GBT_PIECE; a++) (&pull[0][0][0])[a] = (&work.gradient[0][0][0])[a];
    gbt_pull_back(&work, lambda, pull);
    gbt_newton_step(&work, pull);
    eliminate(h, g);
    for (int a = 0; a < N; a++) {
        worst = fmax(worst, fabs(*gbt_free(work.step[a / GBT_FREE], a % GBT_FREE) + g[a]));
        largest = fmax(largest, fabs(g[a]));
    }
    return worst / largest;
}

/* 1 if the Riccati recursion calls the Hessian positive definite exactly where its smallest eigenvalue is positive:
   delta just below and just above what lifts it is to be found by bisection of the dense Cholesky factorisation. */
int check_inertia(int seed, const double *parameters)
{
    static double h[N][N];
    draw(seed, parameters);
    gradient(start, x, lambda, h[0]);
    for (int k = 0; k < GBT_COUNT; k++) {
        work.lambda[k] = 10 * lambda[k];
        work.sigma[k] = 0;
    }
    gbt_assemble(&work);
    for (double delta = 1e-3; delta < 1e9; delta *= 1.5) {
        int definite = 1;
        dense(delta, h);
        for (int k = 0; k < N && definite; k++) {
            definite = h[k][k] > 0;
            for (int r = k + 1; r < N; r++)
                for (int c = k + 1; c < N; c++) h[r][c] -= h[r][k] * h[k][c] / h[k][k];
        }
        if (definite != gbt_factorise(&work, delta)) return 0;
    }
    return 1;
}
