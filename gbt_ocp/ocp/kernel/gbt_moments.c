#include "gbt_moments.h"

#include "gbt_math.h"
#include "gbt_places.h"

#define D GBT_DIMENSION
#define SWEEPS 12 /* of Jacobi's method, which converges quadratically: 3 x 3 needs about 5 */

/* Turns rows and columns p and q of a, and columns p and q of v, so that a[p][q] vanishes. */
static void turn(gbt_real a[D][D], gbt_real v[D][D], int p, int q)
{
    if (a[p][q] == 0) return;
    const gbt_real theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    const gbt_real t = (theta >= 0 ? 1 : -1) / (gbt_fabs(theta) + gbt_sqrt(theta * theta + 1));
    const gbt_real c = 1 / gbt_sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < D; k++) {
        const gbt_real kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < D; k++) {
        const gbt_real pk = a[p][k], qk = a[q][k], vp = v[k][p], vq = v[k][q];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
        v[k][p] = c * vp - s * vq;
        v[k][q] = s * vp + c * vq;
    }
    a[p][q] = a[q][p] = 0;
}

void gbt_diagonalise(gbt_real a[D][D], gbt_real v[D][D])
{
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) v[p][q] = p == q;
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int p = 0; p < D; p++)
            for (int q = p + 1; q < D; q++) turn(a, v, p, q);
}

void gbt_symmetric_root(const gbt_real *matrix, gbt_real *root)
{
    gbt_real a[D][D], v[D][D];
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) a[p][q] = p >= q ? matrix[q * D + p] : matrix[p * D + q];
    gbt_diagonalise(a, v);
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) {
            gbt_real value = 0;
            for (int k = 0; k < D; k++)
                if (a[k][k] > 0) value += v[p][k] * gbt_sqrt(a[k][k]) * v[q][k];
            root[q * D + p] = value;
        }
}

#if GBT_MOMENTS
static void widen(const gbt_real *from, int count, double *to)
{
    for (int k = 0; k < count; k++) to[k] = (double)from[k];
}

static void place_of(const double *base, const gbt_real *mean, double *place)
{
    for (int j = 0; j < D; j++) place[j] = base[j] + (double)mean[j];
}

void gbt_bind(const double *base, const double *origin, const gbt_real *mean, const gbt_real *covariance,
              const gbt_real *desired, gbt_real *numbers)
{
    double place[D], matrix[D * D], wanted[D], given[GBT_PARAMETERS + 1];
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_real root[D * D];
        const int end = i + GBT_PRESENT;
        gbt_symmetric_root(covariance + end * D * D, root);
        widen(root, D * D, matrix);
        widen(desired + i * D, D, wanted);
        place_of(base, mean + end * D, place);
        gbt_prepare(place, matrix, wanted, given);
        gbt_place_ends(origin, given, 1, numbers + i * GBT_END_NUMBERS);
    }
    for (int i = 0; i <= GBT_PIECES; i++) {
        double moving[GBT_MOVING + 1];
#if GBT_PRESENT
        double past[D * D + D + 1];
        widen(covariance, D * D, past);
        place_of(base, mean + (i > 0 ? i - 1 : 0) * D, past + D * D);
        past[D * D + D] = i > 0;
        widen(covariance + i * D * D, D * D, matrix);
        place_of(base, mean + i * D, place);
        gbt_prepare_limits(place, matrix, past, moving);
#endif
        gbt_place_knots(origin, moving, 1, numbers + GBT_LIMIT_NUMBERS + i * GBT_KNOT_NUMBERS);
    }
}
#endif
