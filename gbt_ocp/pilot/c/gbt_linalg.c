#include "gbt_linalg.h"

#include "gbt_math.h"

#define SWEEPS 20 /* of Jacobi's method, which converges quadratically: 10 x 10 needs about 8 */

int gbt_solve_square(gbt_real *a, int n, gbt_real *b, int columns)
{
    for (int i = 0; i < n; i++) {
        int pivot = i;
        for (int r = i + 1; r < n; r++)
            if (gbt_fabs(a[r * n + i]) > gbt_fabs(a[pivot * n + i])) pivot = r;
        if (!(gbt_fabs(a[pivot * n + i]) > 0)) return 0;
        for (int c = 0; pivot != i && c < n; c++) {
            const gbt_real kept = a[i * n + c];
            a[i * n + c] = a[pivot * n + c];
            a[pivot * n + c] = kept;
        }
        for (int c = 0; pivot != i && c < columns; c++) {
            const gbt_real kept = b[i * columns + c];
            b[i * columns + c] = b[pivot * columns + c];
            b[pivot * columns + c] = kept;
        }
        for (int r = i + 1; r < n; r++) {
            const gbt_real share = a[r * n + i] / a[i * n + i];
            for (int c = i; c < n; c++) a[r * n + c] -= share * a[i * n + c];
            for (int c = 0; c < columns; c++) b[r * columns + c] -= share * b[i * columns + c];
        }
    }
    for (int i = n - 1; i >= 0; i--)
        for (int c = 0; c < columns; c++) {
            for (int k = i + 1; k < n; k++) b[i * columns + c] -= a[i * n + k] * b[k * columns + c];
            b[i * columns + c] /= a[i * n + i];
        }
    return 1;
}

void gbt_symmetric(gbt_real *a, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) a[i * n + j] = a[j * n + i] = (a[i * n + j] + a[j * n + i]) / 2;
}

void gbt_congruent(const gbt_real *a, const gbt_real *b, int n, gbt_real *out)
{
    gbt_real half[GBT_LARGEST * GBT_LARGEST];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            half[i * n + j] = 0;
            for (int k = 0; k < n; k++) half[i * n + j] += a[i * n + k] * b[k * n + j];
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            out[i * n + j] = 0;
            for (int k = 0; k < n; k++) out[i * n + j] += half[i * n + k] * a[j * n + k];
        }
    gbt_symmetric(out, n);
}

/* The lower Cholesky factor; 0 if there is none. */
static int cholesky(const gbt_real *a, int n, gbt_real *l)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            gbt_real rest = a[i * n + j];
            if (j > i) {
                l[i * n + j] = 0;
                continue;
            }
            for (int k = 0; k < j; k++) rest -= l[i * n + k] * l[j * n + k];
            if (j == i && !(rest > 0)) return 0;
            l[i * n + j] = j == i ? gbt_sqrt(rest) : rest / l[j * n + j];
        }
    return 1;
}

/* Turns rows and columns p and q of a, and columns p and q of v, so that a[p][q] vanishes. */
static void turn(gbt_real *a, gbt_real *v, int n, int p, int q)
{
    if (a[p * n + q] == 0) return;
    const gbt_real theta = (a[q * n + q] - a[p * n + p]) / (2 * a[p * n + q]);
    const gbt_real t = (theta >= 0 ? 1 : -1) / (gbt_fabs(theta) + gbt_sqrt(theta * theta + 1));
    const gbt_real c = 1 / gbt_sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < n; k++) {
        const gbt_real kp = a[k * n + p], kq = a[k * n + q];
        a[k * n + p] = c * kp - s * kq;
        a[k * n + q] = s * kp + c * kq;
    }
    for (int k = 0; k < n; k++) {
        const gbt_real pk = a[p * n + k], qk = a[q * n + k], vp = v[k * n + p], vq = v[k * n + q];
        a[p * n + k] = c * pk - s * qk;
        a[q * n + k] = s * pk + c * qk;
        v[k * n + p] = c * vp - s * vq;
        v[k * n + q] = s * vp + c * vq;
    }
    a[p * n + q] = a[q * n + p] = 0;
}

void gbt_eigen(gbt_real *a, int n, gbt_real *vectors)
{
    for (int k = 0; k < n * n; k++) vectors[k] = k % (n + 1) == 0;
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) turn(a, vectors, n, p, q);
}

void gbt_covariance_root(const gbt_real *covariance, int n, gbt_real *l)
{
    gbt_real a[GBT_LARGEST * GBT_LARGEST];
    if (cholesky(covariance, n, l)) return;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) a[i * n + j] = covariance[i >= j ? i * n + j : j * n + i];
    gbt_eigen(a, n, l);
    for (int j = 0; j < n; j++) {
        const gbt_real value = a[j * n + j], root = value > 0 ? gbt_sqrt(value) : 0;
        for (int i = 0; i < n; i++) l[i * n + j] *= root;
    }
}

int gbt_factor_lower(gbt_real *lower, int n)
{
    for (int i = 0; i < n; i++) {
        gbt_real *row = &lower[GBT_ROW_BEGIN(i)], rest;
        for (int j = 0; j < i; j++) {
            const gbt_real *above = &lower[GBT_ROW_BEGIN(j)];
            rest = row[j];
            for (int k = 0; k < j; k++) rest -= row[k] * above[k];
            row[j] = rest / above[j];
        }
        rest = row[i];
        for (int k = 0; k < i; k++) rest -= row[k] * row[k];
        if (!(rest > 0 && isfinite(rest))) return 0;
        row[i] = gbt_sqrt(rest);
    }
    return 1;
}

void gbt_solve_lower(const gbt_real *lower, int n, gbt_real *x)
{
    for (int i = 0; i < n; i++) {
        const gbt_real *row = &lower[GBT_ROW_BEGIN(i)];
        for (int k = 0; k < i; k++) x[i] -= row[k] * x[k];
        x[i] /= row[i];
    }
}

void gbt_solve_upper(const gbt_real *lower, int n, gbt_real *x)
{
    for (int i = n - 1; i >= 0; i--) {
        const gbt_real *row = &lower[GBT_ROW_BEGIN(i)];
        x[i] /= row[i];
        for (int k = 0; k < i; k++) x[k] -= row[k] * x[i];
    }
}
