#include "gbt_decide.h"

#include "gbt_bearing.h"
#include "gbt_math.h"
#if !GBT_SHOOTING
#include "gbt_trajectory.h"
#endif

#define D GBT_DIMENSION
#define ON_SCHEDULE 1e-6                  /* deviation in seconds up to which a step counts as one on time */
#define ON_PLAN ((gbt_real)1e-6)          /* distance from a plan that counts as on it, m, rad, and per second */
#define RANGE_OBSERVABLE ((gbt_real)0.25) /* deviation of the range over the range below which it counts as known */

int gbt_finite(const gbt_real *x, int count)
{
    for (int k = 0; k < count; k++)
        if (!isfinite(x[k])) return 0;
    return 1;
}

const gbt_own_state *gbt_latest(const gbt_pilot *pilot)
{
    return pilot->own.count > 0 ? &pilot->own.state[pilot->own.count - 1] : 0;
}

gbt_real gbt_water(const gbt_pilot *pilot, int j)
{
#if GBT_CURRENT
    return j < D ? pilot->current.planned_for[j] : 0;
#else
    (void)pilot;
    (void)j;
    return 0;
#endif
}

#if GBT_SHOOTING
void gbt_carry_on(const gbt_pilot *pilot, const gbt_own_state *own, double time, gbt_real *z, gbt_real *dz)
{
    (void)pilot;
    (void)time;
    for (int j = 0; j < GBT_FLAT; j++) {
        z[j] = own->pose[j];
        dz[j] = own->rates[j];
    }
}

static void flat_of(const gbt_pilot *pilot, double time, const gbt_real *z, const gbt_real *dz,
                    gbt_real flat[GBT_JOINED][GBT_FLAT])
{
    (void)pilot;
    (void)time;
    for (int j = 0; j < GBT_FLAT; j++) {
        flat[0][j] = z[j];
        flat[1][j] = dz[j];
    }
}
#else
void gbt_carry_on(const gbt_pilot *pilot, const gbt_own_state *own, double time, gbt_real *z, gbt_real *dz)
{
    const gbt_own_state *last = gbt_latest(pilot);
    const double since = last ? last->time - pilot->decided_at + pilot->guidance.elapsed : -1;
    const int on_plan = last && pilot->following && since >= 0 && last->time < time &&
                        time <= last->time + gbt_pilot_numbers.navigation_gap;
    for (int j = 0; j < GBT_FLAT; j++) {
        z[j] = on_plan ? last->pose[j] : own->pose[j];
        dz[j] = on_plan ? last->rates[j] : own->rates[j];
    }
    if (!on_plan) return;
    gbt_real then[GBT_ORDERS][GBT_FLAT], now[GBT_ORDERS][GBT_FLAT];
    gbt_trajectory_at(&pilot->guidance.follower, since, then);
    gbt_trajectory_at(&pilot->guidance.follower, since + time - last->time, now);
    for (int j = 0; j < GBT_FLAT; j++) {
        z[j] += now[0][j] - then[0][j] + gbt_water(pilot, j) * (gbt_real)(time - last->time);
        dz[j] += now[1][j] - then[1][j];
    }
}

/* Derivatives of the flat output now: the plan's own on a step on time where the vehicle is on its plan; otherwise those
   above the rate are the plan's. */
static void flat_of(const gbt_pilot *pilot, double time, const gbt_real *z, const gbt_real *dz,
                    gbt_real flat[GBT_JOINED][GBT_FLAT])
{
    const gbt_follower *plan = &pilot->guidance.follower;
    const double since = time - pilot->decided_at;
    gbt_real planned[GBT_ORDERS][GBT_FLAT], off = 0;
    for (int j = 0; j < GBT_FLAT; j++) {
        for (int l = 2; l < GBT_JOINED; l++) flat[l][j] = 0;
        flat[0][j] = z[j];
        flat[1][j] = dz[j];
    }
    if (!pilot->following) return;
    if (fabs(since - gbt_pilot_numbers.period) <= ON_SCHEDULE) {
        const double through = pilot->guidance.elapsed + gbt_pilot_numbers.period;
        gbt_trajectory_at(plan, through, planned);
        for (int j = 0; j < GBT_FLAT; j++) {
            if (j < D) planned[0][j] += plan->start[0][j];
            planned[0][j] += gbt_water(pilot, j) * (gbt_real)through;
            planned[1][j] += gbt_water(pilot, j);
            off = gbt_fmax(off, gbt_fmax(gbt_fabs(planned[0][j] - z[j]), gbt_fabs(planned[1][j] - dz[j])));
        }
        for (int a = 0; off <= ON_PLAN && a < GBT_MOTION; a++)
            flat[a / GBT_FLAT][a % GBT_FLAT] = planned[a / GBT_FLAT][a % GBT_FLAT];
        if (off <= ON_PLAN) return;
    }
    gbt_trajectory_at(plan, pilot->guidance.elapsed + since, planned);
    for (int l = 2; l < GBT_JOINED; l++)
        for (int j = 0; j < GBT_FLAT; j++) flat[l][j] = planned[l][j];
}

#endif

/* Predicts; a forecast that is not finite is kept as it is, but the guidance is given the last finite one in its place, a
   period further on, and without any the vehicle's own position. */
static void predict(gbt_pilot *pilot, double time, const gbt_real *own)
{
    gbt_forecast *forecast = &pilot->forecast, *usable = &pilot->usable;
    int finite = 1;
    gbt_tracker_predict(&pilot->tracker, &pilot->guidance.room.tracking.work, time, forecast);
    for (int k = 0; k <= GBT_AHEAD; k++) {
        finite = finite && gbt_finite(forecast->mean[k], D);
        for (int a = 0; a < D * D; a++) finite = finite && !isinf(forecast->covariance[k][a / D][a % D]);
    }
    pilot->held = !finite;
    if (finite) {
        *usable = *forecast;
    } else {
        for (int k = 0; k <= GBT_AHEAD; k++) {
            const int from = k < GBT_AHEAD ? k + 1 : k;
            for (int p = 0; p < D; p++) {
                usable->mean[k][p] = pilot->usable_forecast ? usable->mean[from][p] : own[p];
                for (int q = 0; q < D; q++)
                    usable->covariance[k][p][q] =
                        pilot->usable_forecast ? usable->covariance[from][p][q] : (gbt_real)NAN;
            }
        }
    }
    pilot->usable_forecast = 1;
}

/* Whether the deviation of the range is below a quarter of the range. */
static int range_is_known(const gbt_forecast *forecast, const gbt_real *own)
{
    gbt_real line[D], along = 0;
    for (int p = 0; p < D; p++) line[p] = forecast->mean[0][p] - own[p];
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++) along += line[p] * forecast->covariance[0][p][q] * line[q];
    return gbt_sqrt(along > 0 || isnan(along) ? along : 0) < RANGE_OBSERVABLE * gbt_dot(line, line);
}

int gbt_decide(gbt_pilot *pilot, double time, const gbt_real *z, const gbt_real *dz)
{
    gbt_real flat[GBT_JOINED][GBT_FLAT];
#if GBT_CURRENT == 2
    gbt_current_learn(&pilot->current, gbt_latest(pilot));
#endif
    flat_of(pilot, time, z, dz, flat);
    predict(pilot, time, flat[0]);
#if GBT_CURRENT
    gbt_forecast drifting;
    gbt_through_water(&pilot->current, flat);
    gbt_drift(&pilot->current, &pilot->usable, &drifting);
    const gbt_decision decision = gbt_guidance_decide(&pilot->guidance, time, flat, &drifting);
#else
    const gbt_decision decision = gbt_guidance_decide(&pilot->guidance, time, flat, &pilot->usable);
#endif
    if (decision == GBT_DECIDED_NOTHING) return 0;
#if GBT_CURRENT
    for (int p = 0; p < D && decision == GBT_DECIDED_PLAN; p++) /* a plan that is followed on stays one for its current */
        pilot->current.planned_for[p] = pilot->current.velocity[p];
#endif
    gbt_watch_forecast(&pilot->watch, &pilot->forecast, z);
    pilot->range_known = range_is_known(&pilot->forecast, z);
    if (decision == GBT_DECIDED_PLAN) pilot->planned = 1;
    pilot->following = decision != GBT_DECIDED_CROSS;
    pilot->decided = 1;
    pilot->decided_at = time;
    return 1;
}
