#include "gbt_bearing.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define HALF_TURN ((gbt_real)3.141592653589793)

gbt_real gbt_dot(const gbt_real *a, const gbt_real *b)
{
    gbt_real sum = 0;
    for (int k = 0; k < D; k++) sum += a[k] * b[k];
    return sum;
}

gbt_real gbt_length(const gbt_real *a) { return gbt_sqrt(gbt_dot(a, a)); }

int gbt_unit_bearing(const gbt_real *target, const gbt_real *own, gbt_real *bearing)
{
    /* over the largest component first, so that the square neither overflows nor vanishes */
    gbt_real largest = 0;
    for (int k = 0; k < D; k++) {
        bearing[k] = target[k] - own[k];
        largest = gbt_fmax(largest, gbt_fabs(bearing[k]));
    }
    if (!(largest > 0)) return 0;
    for (int k = 0; k < D; k++) bearing[k] /= largest;
    const gbt_real size = gbt_length(bearing);
    for (int k = 0; k < D; k++) bearing[k] /= size;
    return 1;
}

void gbt_unit_of_angles(const gbt_real *angles, gbt_real *bearing)
{
    bearing[0] = gbt_cos(angles[0]);
    bearing[1] = gbt_sin(angles[0]);
#if GBT_DIMENSION == 3
    const gbt_real level = gbt_cos(angles[1]);
    bearing[0] *= level;
    bearing[1] *= level;
    bearing[2] = gbt_sin(angles[1]);
#endif
}

void gbt_angles_of(const gbt_real *bearing, gbt_real *angles)
{
    angles[0] = gbt_atan2(bearing[1], bearing[0]);
#if GBT_DIMENSION == 3
    angles[1] = gbt_atan2(bearing[2], gbt_hypot(bearing[0], bearing[1]));
#endif
}

void gbt_tangent_basis(const gbt_real *bearing, gbt_real basis[GBT_AXES][D])
{
#if GBT_DIMENSION == 2
    basis[0][0] = -bearing[1];
    basis[0][1] = bearing[0];
#else
    const gbt_real x = bearing[0], y = bearing[1], z = bearing[2];
    /* 1 + z loses its digits near -e_z; for a unit vector the other form is the same number without cancellation */
    const gbt_real above = z < 0 ? (x * x + y * y) / (1 - z) : 1 + z;
    const int pole = above == 0;
    const gbt_real scale = pole ? 1 : 1 / above;
    basis[0][0] = 1 - x * x * scale;
    basis[0][1] = basis[1][0] = -x * y * scale;
    basis[0][2] = -x;
    basis[1][1] = pole ? -1 : 1 - y * y * scale;
    basis[1][2] = -y;
#endif
}

void gbt_rotate_bearing(const gbt_real *bearing, const gbt_real *angle, gbt_real *turned)
{
    gbt_real basis[GBT_AXES][D], square = 0;
    for (int a = 0; a < GBT_AXES; a++) square += angle[a] * angle[a];
    const gbt_real size = gbt_sqrt(square), cosine = gbt_cos(size), part = size > 0 ? gbt_sin(size) / size : 1;
    gbt_tangent_basis(bearing, basis);
    for (int k = 0; k < D; k++) {
        turned[k] = cosine * bearing[k];
        for (int a = 0; a < GBT_AXES; a++) turned[k] += basis[a][k] * angle[a] * part;
    }
    const gbt_real length = gbt_length(turned);
    for (int k = 0; k < D; k++) turned[k] /= length;
}

void gbt_log_map(const gbt_real *expected, const gbt_real *measured, gbt_real basis[GBT_AXES][D], gbt_real *angle)
{
    const gbt_real cosine = gbt_dot(expected, measured);
    for (int a = 0; a < GBT_AXES; a++) angle[a] = gbt_dot(basis[a], measured);
#if GBT_DIMENSION == 2
    angle[0] = gbt_atan2(angle[0], cosine);
#else
    const gbt_real sine = gbt_hypot(angle[0], angle[1]);
    if (sine == 0) {
        if (cosine < 0) angle[0] = HALF_TURN;
        return;
    }
    const gbt_real longer = gbt_atan2(sine, cosine) / sine;
    for (int a = 0; a < GBT_AXES; a++) angle[a] *= longer;
#endif
}

void gbt_across(gbt_real basis[GBT_AXES][D], const gbt_real *covariance, gbt_real *across)
{
    for (int a = 0; a < GBT_AXES; a++)
        for (int b = 0; b < GBT_AXES; b++) {
            gbt_real sum = 0;
            for (int i = 0; i < D; i++)
                for (int j = 0; j < D; j++) sum += basis[a][i] * covariance[i * D + j] * basis[b][j];
            across[a * GBT_AXES + b] = sum;
        }
}
