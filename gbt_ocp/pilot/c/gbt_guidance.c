#include "gbt_guidance.h"

#include "gbt_bearing.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define ON_SCHEDULE 1e-6 /* deviation in seconds up to which a step counts as one on time */

void gbt_guidance_begin(gbt_guidance *guidance)
{
    const gbt_pilot_settings *numbers = &gbt_pilot_numbers;
    gbt_plan_init(&guidance->room.planner);
#if !GBT_SHOOTING
    gbt_follow_init(&guidance->follower, numbers->follow_bandwidth);
    gbt_thrusters_init(&guidance->thrusters, numbers->thrust_lag);
    gbt_disturbance_init(&guidance->disturbance);
#endif
    gbt_startup_init(&guidance->startup, numbers->axis, numbers->startup_deviation, numbers->startup_speed,
                     numbers->startup_opening, numbers->startup_leg, numbers->startup_nearest,
                     (gbt_real)numbers->period);
    guidance->desired.rate = numbers->desired_rate;
    guidance->desired.phase = numbers->desired_phase;
    guidance->desired.reverse = numbers->desired_reverse;
    guidance->desired.leg_start = numbers->desired_leg_start;
    for (int k = 0; k < 3; k++) guidance->desired.axis[k] = numbers->desired_axis[k];
    guidance->desired.speed = numbers->desired_speed;
    guidance->desired.across = numbers->desired_across;
    guidance->desired.changed = guidance->desired.turned = 0;
    guidance->desired.pace = 1;
    guidance->planned = guidance->legs_begun = 0;
    guidance->planned_at = guidance->elapsed = 0;
    for (int i = 0; i < GBT_INPUTS; i++) guidance->thrust[i] = 0;
}

/* Seconds since the last plan; whether they are less than a piece. */
static int elapsed(const gbt_guidance *guidance, double time, double *seconds)
{
    const double since = time - guidance->planned_at, period = (double)GBT_PERIOD;
    const double count = rint(since * GBT_PERIODS / period), on_time = count * period / GBT_PERIODS;
    *seconds = fabs(since - on_time) <= ON_SCHEDULE ? on_time : since;
    return count < GBT_PERIODS;
}

/* The desired bearings at the ends of a plan: at the pace that the range allows, or on from the line of sight. */
static void desire(gbt_guidance *guidance, double time, gbt_real flat[GBT_JOINED][GBT_FLAT],
                   const gbt_forecast *forecast, gbt_real bearings[GBT_PIECES][D])
{
    const int next = GBT_STRIDE < GBT_AHEAD ? GBT_STRIDE : GBT_AHEAD;
    gbt_real line[D], velocity[D];
    for (int k = 0; k < D; k++) {
        line[k] = forecast->mean[0][k] - flat[0][k];
        velocity[k] = (forecast->mean[next][k] - forecast->mean[0][k]) / GBT_PERIOD - flat[1][k];
    }
    if (gbt_pilot_numbers.desired_speed > 0) {
        gbt_desired_pace(&guidance->desired, time, (double)gbt_length(line));
    } else if (gbt_pilot_numbers.begin_at_sight) {
        if (!guidance->legs_begun) gbt_desired_reverse_from(&guidance->desired, time, line, velocity);
        guidance->legs_begun = 1;
        if (gbt_pilot_numbers.desired_across > 0) {
            gbt_real target[GBT_PIECES + 1][D];
            for (int i = 0; i <= GBT_PIECES; i++)
                for (int k = 0; k < D; k++) target[i][k] = forecast->mean[i * GBT_STRIDE][k];
            gbt_desired_sweep(&guidance->desired, time, line, target, bearings);
            return;
        }
        gbt_desired_begin_at(&guidance->desired, time, line);
    }
    for (int i = 0; i < GBT_PIECES; i++)
        gbt_desired_at(&guidance->desired, time + (double)GBT_PERIOD * (i + 1), bearings[i]);
}

/* An estimator without a covariance is taken at its word. */
static gbt_real known(gbt_real variance) { return isnan(variance) ? 0 : variance; }

#if GBT_SHOOTING
/* The state from which is planned, with the inputs that act now where their rates are limited. */
static void begin_plan(gbt_guidance *guidance, gbt_real flat[GBT_JOINED][GBT_FLAT])
{
    gbt_driven_state(flat[0], flat[1], 0, guidance->began);
#if GBT_LAST < GBT_STATES
    for (int j = 0; j < GBT_INPUTS; j++) {
        const gbt_real planned = guidance->room.planner.warm ? guidance->plan.top[0][GBT_FREE - GBT_INPUTS + j] : 0;
        guidance->began[GBT_LAST + j] = guidance->acts ? guidance->acting[j] : planned;
    }
#endif
}
#endif

void gbt_guidance_replace(gbt_guidance *guidance, const gbt_real *top)
{
    for (int a = 0; a < GBT_PIECES * GBT_FREE; a++) {
        guidance->room.planner.previous[a / GBT_FREE][a % GBT_FREE] = top[a];
        guidance->plan.top[a / GBT_FREE][a % GBT_FREE] = top[a];
#if !GBT_SHOOTING
        guidance->follower.top[a / GBT_FREE][a % GBT_FREE] = top[a];
#endif
    }
#if GBT_SHOOTING
    gbt_regulator_replace(&guidance->regulator, guidance->began, guidance->plan.top);
#endif
}

static gbt_decision plan(gbt_guidance *guidance, double time, gbt_real flat[GBT_JOINED][GBT_FLAT],
                         const gbt_forecast *forecast)
{
    enum { BOUNDARIES = GBT_PIECES + GBT_PRESENT };
    gbt_real mean[BOUNDARIES][D], covariance[BOUNDARIES][D][D], desired[GBT_PIECES][D];
    if (guidance->planned && elapsed(guidance, time, &guidance->elapsed)) return GBT_DECIDED_FOLLOW;
    for (int i = 0; i < BOUNDARIES; i++) {
        const int place = (i + 1 - GBT_PRESENT) * GBT_STRIDE;
        for (int p = 0; p < D; p++) {
            mean[i][p] = forecast->mean[place][p];
            for (int q = 0; q < D; q++) covariance[i][p][q] = known(forecast->covariance[place][p][q]);
        }
    }
    desire(guidance, time, flat, forecast, desired);
#if GBT_SHOOTING
    begin_plan(guidance, flat);
    const gbt_real *state = guidance->began;
#else
    gbt_real state[GBT_STATE];
    /* the acceleration that acts is that of the first piece of the last plan, if there was one */
    for (int a = 0; a < GBT_STATE; a++)
        state[a] = a < GBT_MOTION ? flat[a / GBT_FLAT][a % GBT_FLAT] : guidance->room.planner.previous[0][a - GBT_MOTION];
#endif
    gbt_plan(&guidance->room.planner, state, &mean[0][0], &covariance[0][0][0], &desired[0][0], &guidance->plan);
    if (guidance->plan.origin == GBT_NO_PLAN) return GBT_DECIDED_NOTHING;
#if GBT_SHOOTING
    gbt_regulator_plan(&guidance->regulator, state, guidance->plan.top);
    guidance->acts = 0;
#else
    gbt_follow_plan(&guidance->follower, state, &guidance->plan.top[0][0]);
#endif
    guidance->planned = 1;
    guidance->planned_at = time;
    guidance->elapsed = 0;
    return GBT_DECIDED_PLAN;
}

/* Crosses the line of sight, or says that it is time to plan. */
static gbt_startup_status cross(gbt_guidance *guidance, double time, gbt_real flat[GBT_JOINED][GBT_FLAT],
                                const gbt_forecast *forecast)
{
    gbt_real covariance[D][D];
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) covariance[p][q] = known(forecast->covariance[0][p][q]);
#if GBT_SHOOTING
    gbt_real velocity[D];
    const gbt_startup_status status = gbt_startup_velocity(&guidance->startup, (gbt_real)time, flat[0],
                                                           forecast->mean[0], &covariance[0][0], velocity);
    if (status == GBT_STARTUP_CROSS) {
        gbt_helm_turning_away(flat[0], forecast->mean[0], velocity);
        gbt_helm_reach(&guidance->helm, flat[0], flat[1], velocity, guidance->thrust);
        guidance->acts = 1;
        for (int j = 0; j < GBT_INPUTS; j++) guidance->acting[j] = guidance->thrust[j];
    }
    if (status == GBT_STARTUP_RESTART && !guidance->acts && guidance->room.planner.warm) {
        guidance->acts = 1;
        for (int j = 0; j < GBT_INPUTS; j++) guidance->acting[j] = guidance->plan.top[0][GBT_FREE - GBT_INPUTS + j];
    }
    return status;
#else
    return gbt_startup_step(&guidance->startup, (gbt_real)time, flat[0], flat[1], forecast->mean[0], &covariance[0][0],
                            guidance->thrust);
#endif
}

gbt_decision gbt_guidance_decide(gbt_guidance *guidance, double time, gbt_real flat[GBT_JOINED][GBT_FLAT],
                                 const gbt_forecast *forecast)
{
    if (gbt_pilot_numbers.startup_deviation > 0) {
        switch (cross(guidance, time, flat, forecast)) {
        case GBT_STARTUP_CROSS: return GBT_DECIDED_CROSS;
        case GBT_STARTUP_NOT_FINITE: return GBT_DECIDED_NOTHING;
        case GBT_STARTUP_RESTART:
            guidance->planned = guidance->legs_begun = guidance->room.planner.warm = 0;
            break;
        case GBT_STARTUP_PLAN: break;
        }
    }
    return plan(guidance, time, flat, forecast);
}
