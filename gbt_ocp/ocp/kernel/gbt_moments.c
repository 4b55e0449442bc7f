#include "gbt_moments.h"

#include "gbt_math.h"

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

void gbt_symmetric_root(const gbt_real *matrix, gbt_real *root)
{
    gbt_real a[D][D], v[D][D];
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) {
            a[p][q] = p >= q ? matrix[q * D + p] : matrix[p * D + q];
            v[p][q] = p == q;
        }
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int p = 0; p < D; p++)
            for (int q = p + 1; q < D; q++) turn(a, v, p, q);
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) {
            gbt_real value = 0;
            for (int k = 0; k < D; k++)
                if (a[k][k] > 0) value += v[p][k] * gbt_sqrt(a[k][k]) * v[q][k];
            root[q * D + p] = value;
        }
}

#if GBT_MOMENTS
void gbt_bind(const gbt_real *mean, const gbt_real *covariance, const gbt_real *desired, gbt_real *parameters)
{
    gbt_real root[D * D];
    for (int i = 0; i < GBT_PIECES; i++) {
        const int end = i + GBT_PRESENT;
        gbt_symmetric_root(covariance + end * D * D, root);
        gbt_prepare(mean + end * D, root, desired + i * D, parameters + i * GBT_PARAMETERS);
    }
#if GBT_PRESENT
    for (int i = 0; i <= GBT_PIECES; i++)
        gbt_prepare_limits(mean + i * D, covariance + i * D * D, covariance,
                           parameters + GBT_LIMIT_NUMBERS + i * GBT_MOVING);
#endif
}
#endif
