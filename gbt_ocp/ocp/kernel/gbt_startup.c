#include "gbt_startup.h"

#include "gbt_math.h"
#include "gbt_thrust.h"

#define D GBT_DIMENSION
#define OBSERVED ((gbt_real)0.25) /* deviation over the range below which what is believed of it is more than its prior */
#define SPREADS 2                 /* deviations by which a believed range has to be above the nearest one */
#define CLEARED 10                /* time within which a vehicle that is nearer than that goes to be clear, s */
#define CLEARING ((gbt_real)0.8)  /* most of the speed that leads away; the rest is across, for the range's sake */
#define STRAIGHT ((gbt_real)1e-9) /* size of a cross product below which its factors count as parallel */

static int all_finite(const gbt_real *x, int count)
{
    for (int k = 0; k < count; k++)
        if (!isfinite(x[k])) return 0;
    return 1;
}

static gbt_real length(const gbt_real *x)
{
    gbt_real square = 0;
    for (int k = 0; k < D; k++) square += x[k] * x[k];
    return gbt_sqrt(square);
}

/* x over its length, or the first axis where it is no longer than the least. */
static void normalise(gbt_real *x, gbt_real least)
{
    const gbt_real size = length(x);
    for (int k = 0; k < D; k++) x[k] = size > least ? x[k] / size : k == 0;
}

void gbt_startup_init(gbt_startup *startup, const gbt_real *axis, gbt_real deviation, gbt_real speed, gbt_real opening,
                      gbt_real leg, gbt_real nearest, gbt_real period)
{
    startup->axis[0] = startup->axis[1] = startup->axis[2] = 0;
    if (D == 3) {
        for (int k = 0; k < D; k++) startup->axis[k] = axis[k];
        normalise(startup->axis, 0);
    }
    startup->deviation = deviation;
    startup->speed = speed;
    startup->opening = opening;
    startup->leg = leg;
    startup->nearest = nearest;
    startup->period = period;
    startup->known = startup->crossing = 0;
    startup->began = 0;
}

/* The direction in which the line of sight turns with the desired bearing. */
static void turn_of(const gbt_startup *startup, const gbt_real *sight, gbt_real *turn)
{
#if GBT_DIMENSION == 2
    (void)startup;
    turn[0] = -sight[1];
    turn[1] = sight[0];
#else
    for (int k = 0; k < 3; k++) {
        const int p = (k + 1) % 3, q = (k + 2) % 3;
        turn[k] = startup->axis[p] * sight[q] - startup->axis[q] * sight[p];
    }
#endif
    normalise(turn, STRAIGHT);
}

/* The speed away from a target believed at a distance of this deviation: more where that may be too near. */
static gbt_real opening_of(const gbt_startup *startup, gbt_real distance, gbt_real spread)
{
    if (startup->nearest == 0 || spread >= OBSERVED * distance) return startup->opening;
    const gbt_real missing = startup->nearest + SPREADS * spread - distance;
    return gbt_fmax(startup->opening, gbt_fmin(missing / CLEARED, CLEARING * startup->speed));
}

gbt_startup_status gbt_startup_velocity(gbt_startup *startup, gbt_real time, const gbt_real *z, const gbt_real *mean,
                                        const gbt_real *covariance, gbt_real *velocity)
{
    gbt_real sight[D], turn[D], variance = 0;
    const int known = startup->known;
    for (int k = 0; k < D; k++) velocity[k] = 0;
    if (!isfinite(time) || !all_finite(z, D) || !all_finite(mean, D) || !all_finite(covariance, D * D))
        return GBT_STARTUP_NOT_FINITE;

    for (int k = 0; k < D; k++) sight[k] = mean[k] - z[k];
    const gbt_real distance = length(sight);
    normalise(sight, 0);
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) variance += sight[p] * covariance[p * D + q] * sight[q];
    const gbt_real spread = variance > 0 ? gbt_sqrt(variance) : 0;
    startup->known = spread < startup->deviation * distance;
    if (startup->known) {
        startup->crossing = 0;
        return known ? GBT_STARTUP_PLAN : GBT_STARTUP_RESTART;
    }
    if (!startup->crossing) {
        startup->crossing = 1;
        startup->began = time;
    }
    const int back = gbt_fmod(gbt_floor((time - startup->began) / startup->leg + (gbt_real)1e-9), (gbt_real)2) > 0;
    turn_of(startup, sight, turn);
    const gbt_real opening = opening_of(startup, distance, spread);
    const gbt_real across = gbt_sqrt(startup->speed * startup->speed - opening * opening);
    for (int k = 0; k < D; k++) velocity[k] = (back ? 1 : -1) * across * turn[k] - opening * sight[k];
    return GBT_STARTUP_CROSS;
}

#if !GBT_SHOOTING
/* Thrust that reaches a velocity within the period and brings all else to rest, within the limits. */
static void reach(const gbt_startup *startup, const gbt_real *z, const gbt_real *dz, const gbt_real *velocity,
                  gbt_real *thrust)
{
    gbt_real point[GBT_POINT];
    for (int j = 0; j < GBT_FLAT; j++) {
        point[j] = z[j];
        point[GBT_FLAT + j] = dz[j];
        point[2 * GBT_FLAT + j] = ((j < D ? velocity[j] : 0) - dz[j]) / startup->period;
    }
    gbt_vehicle_inputs(point, 0, 0, thrust);
    for (int i = 0; i < GBT_INPUTS; i++) thrust[i] = gbt_within_thrust(i, thrust[i], 1);
}

gbt_startup_status gbt_startup_step(gbt_startup *startup, gbt_real time, const gbt_real *z, const gbt_real *dz,
                                    const gbt_real *mean, const gbt_real *covariance, gbt_real *thrust)
{
    gbt_real velocity[D];
    for (int i = 0; i < GBT_INPUTS; i++) thrust[i] = 0;
    if (!all_finite(z, GBT_FLAT) || !all_finite(dz, GBT_FLAT)) return GBT_STARTUP_NOT_FINITE;
    const gbt_startup_status status = gbt_startup_velocity(startup, time, z, mean, covariance, velocity);
    if (status == GBT_STARTUP_CROSS) reach(startup, z, dz, velocity, thrust);
    return status;
}
#endif
