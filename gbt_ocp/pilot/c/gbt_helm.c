#include "gbt_helm.h"

#include "gbt_math.h"
#include "gbt_regulator.h"
#include "gbt_thrust.h"

#if GBT_SHOOTING

#define D GBT_DIMENSION
#define TURN ((gbt_real)6.283185307179586)
#define COURSE_GAIN ((gbt_real)0.8) /* those of guidance/helm.py */
#define RATE_GAIN ((gbt_real)0.6)
#define PITCH_GAIN ((gbt_real)1.5)
#define BEGINNING ((gbt_real)0.3)
#define AWAY ((gbt_real)0.5)
#define SPEED_GAIN ((gbt_real)0.5)
#define STEEPEST ((gbt_real)0.4363323129985824)

static gbt_real between(gbt_real value, gbt_real low, gbt_real high)
{
    return value < low ? low : value > high ? high : value;
}

/* The share of the push that keeps a speed, from those of speeds at even distances. */
static gbt_real push_for(gbt_real speed)
{
    const gbt_real *push = gbt_pilot_numbers.helm_push;
    const gbt_real place = between(speed / gbt_pilot_numbers.helm_fastest, 0, 1) * (GBT_PUSHES - 1);
    const int before = place < GBT_PUSHES - 1 ? (int)place : GBT_PUSHES - 2;
    return push[before] + (place - (gbt_real)before) * (push[before + 1] - push[before]);
}

void gbt_helm_turning_away(const gbt_real *z, const gbt_real *mean, gbt_real *velocity)
{
    const gbt_real c = gbt_cos(z[D]), s = gbt_sin(z[D]), x = mean[0] - z[0], y = mean[1] - z[1];
    const gbt_real distance = gbt_sqrt(x * x + y * y);
    if (c * velocity[0] + s * velocity[1] >= 0 || -c * x - s * y >= AWAY * distance) return;
    const gbt_real share = -gbt_sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1]) / distance;
    velocity[0] = share * x;
    velocity[1] = share * y;
}

void gbt_helm_reach(gbt_helm *helm, const gbt_real *z, const gbt_real *dz, const gbt_real *velocity, gbt_real *inputs)
{
    const gbt_pilot_settings *numbers = &gbt_pilot_numbers;
    gbt_real state[GBT_LAST], square = 0, shares[2];
    gbt_driven_state(z, dz, 0, state);
    for (int k = 0; k < D; k++) square += velocity[k] * velocity[k];
    const gbt_real surge = state[GBT_FLAT], rate = dz[D];
    const gbt_real off = gbt_remainder(gbt_atan2(velocity[1], velocity[0]) - z[D], TURN);
    const gbt_real speed = gbt_fmax(gbt_sqrt(square), numbers->helm_slowest);
    const gbt_real push = push_for(speed) + SPEED_GAIN * (speed - surge);
    const gbt_real moving = gbt_fmax(surge, BEGINNING), most = moving / numbers->helm_radius;
    const gbt_real wanted = between(COURSE_GAIN * off, -most, most);
    shares[0] = between(push, 0, 1);
    shares[1] = between(wanted * numbers->helm_tightest / moving + RATE_GAIN * (wanted - rate), -1, 1);
    gbt_steering(shares, 0, 0, inputs);
#if GBT_DIMENSION == 3
    const gbt_real pitch = between(gbt_asin(between(velocity[2] / speed, -1, 1)), -STEEPEST, STEEPEST);
    inputs[2] = (PITCH_GAIN * (pitch - z[4]) - RATE_GAIN * dz[4]) * gbt_thrust_max[2];
#endif
    for (int j = 0; j < GBT_INPUTS; j++) {
        inputs[j] = gbt_within_thrust(j, inputs[j], 1);
        const gbt_real most_change = (gbt_real)numbers->period * numbers->input_rate[j];
        const gbt_real before = helm->steered ? helm->last[j] : 0;
        if (most_change > 0) inputs[j] = between(inputs[j], before - most_change, before + most_change);
        helm->last[j] = inputs[j];
    }
    helm->steered = 1;
}

#endif
