#include "gbt_first_guess.h"

#include "gbt_bearing.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define UNKNOWN_ELEVATION ((gbt_real)0.5) /* deviation of the elevation at a first azimuth, rad */

/* A position on a bearing: across it wide enough to leave that to the bearing, and no wider. */
static void on_bearing(const gbt_first_guess *guess, const gbt_real *bearing, const gbt_real *own, gbt_real deviation,
                       gbt_real *mean, gbt_real covariance[D][D])
{
    const gbt_real across = gbt_fmax(10 * deviation, (gbt_real)0.1) * guess->range;
    for (int i = 0; i < D; i++) {
        mean[i] = own[i] + guess->range * bearing[i];
        for (int j = 0; j < D; j++) {
            const gbt_real along = bearing[i] * bearing[j];
            covariance[i][j] = guess->range_std * guess->range_std * along + across * across * ((i == j) - along);
        }
    }
}

/* The position before the first measurement is taken; 0 if that does not say where the target is and nothing else does. */
int gbt_guess(const gbt_first_guess *guess, int known, const gbt_real *zero, const gbt_sighting *sighting, gbt_real *mean,
              gbt_real covariance[D][D])
{
    const int azimuth = sighting->kind == GBT_AZIMUTH, both = sighting->kind == GBT_AZIMUTH_ELEVATION;
    gbt_real bearing[D], deviation = guess->bearing_std;
    const gbt_real angles[2] = {sighting->value[0], both ? sighting->value[1] : 0};
    if (known) {
        for (int i = 0; i < D; i++) {
            mean[i] = zero[i] + guess->mean[i];
            for (int j = 0; j < D; j++) covariance[i][j] = guess->covariance[i][j];
        }
        return 1;
    }
    if (sighting->kind == GBT_POSITION) {
        for (int i = 0; i < D; i++) {
            mean[i] = sighting->value[i];
            for (int j = 0; j < D; j++) covariance[i][j] = i == j ? 4 * sighting->std[i] * sighting->std[i] : 0;
        }
        return 1;
    }
    if (!azimuth && !both) return 0;
    for (int k = 0; sighting->stated && k < gbt_components(sighting->kind); k++)
        deviation = gbt_fmax(deviation, sighting->std[k]);
    gbt_unit_of_angles(angles, bearing);
    on_bearing(guess, bearing, sighting->position, deviation, mean, covariance);
    if (azimuth && D == 3)
        covariance[D - 1][D - 1] += UNKNOWN_ELEVATION * guess->range * UNKNOWN_ELEVATION * guess->range;
    return 1;
}
