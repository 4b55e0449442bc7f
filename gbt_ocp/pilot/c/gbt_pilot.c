#include "gbt_pilot.h"

#include "gbt_decide.h"
#include "gbt_math.h"
#include "gbt_origin.h"
#include "gbt_thrust.h"
#if !GBT_SHOOTING
#include "gbt_trajectory.h"
#endif

#define LARGEST 1e12 /* sum of the sizes of a pose and its velocity above which their squares may be no numbers, in single precision */
#define D GBT_DIMENSION

void gbt_pilot_init(gbt_pilot *pilot)
{
    unsigned char *byte = (unsigned char *)pilot;
    for (size_t k = 0; k < sizeof *pilot; k++) byte[k] = 0;
    pilot->now = -HUGE_VAL;
    pilot->intake.latest = -HUGE_VAL;
    gbt_guidance_begin(&pilot->guidance);
#if GBT_CURRENT
    gbt_current_begin(&pilot->current);
#endif
}

size_t gbt_pilot_bytes(void) { return sizeof(gbt_pilot); }

#if GBT_CURRENT
void gbt_pilot_current(const gbt_pilot *pilot, gbt_real *velocity, gbt_real *covariance)
{
    for (int p = 0; p < D; p++) {
        velocity[p] = pilot->current.velocity[p];
        for (int q = 0; q < D; q++) covariance[p * D + q] = pilot->current.spread[p][q];
    }
}
#endif

static gbt_received answered(gbt_pilot *pilot, gbt_received word)
{
    if (word != GBT_TAKEN) pilot->received[word]++;
    return word;
}

double gbt_pilot_waypoint(const gbt_pilot *pilot, int after, gbt_setpoint *waypoint)
{
    *waypoint = (gbt_setpoint){0};
    waypoint->status = GBT_FOLLOW_NO_PLAN;
#if GBT_SHOOTING /* inputs are what its plans are made of, as in Python */
    (void)pilot;
    (void)after;
    return NAN;
#else
    const gbt_guidance *guidance = &pilot->guidance;
    const double period = (double)GBT_PERIOD, began = pilot->decided_at - guidance->elapsed;
    gbt_real water[D];
    if (!pilot->commanded || !pilot->following || after < 0) return NAN;
    const double end = floor((pilot->last.time - began) / period + 1e-9) + 1 + after;
    if (!(end <= GBT_PIECES)) return NAN;
    for (int j = 0; j < D; j++) water[j] = gbt_water(pilot, j);
    gbt_follow_setpoint(&guidance->follower, (gbt_real)(end * period), water, waypoint);
    gbt_origin_give(pilot, waypoint->z);
    return began + end * period;
#endif
}

/* ---- inputs ---- */

gbt_received gbt_pilot_navigate_far(gbt_pilot *pilot, double time, const double *pose, const gbt_real *velocity,
                                    const gbt_real *covariance)
{
    const gbt_real variance = covariance ? covariance[D * GBT_POSE + D] : 0;
    gbt_own_state state;
    double size = 0;
    for (int j = 0; j < GBT_POSE; j++) size += fabs(pose[j]) + fabs((double)velocity[j]);
    if (!(size <= LARGEST) || !isfinite(time) || !isfinite(variance) || variance < 0) return answered(pilot, GBT_NO_NUMBER);
    if (!pilot->begun) {
        gbt_origin_place(pilot, pose, state.pose);
        gbt_tracker_begin(&pilot->tracker, state.pose);
        gbt_intake_begin(&pilot->intake, &pilot->tracker);
        gbt_origin_begin(pilot, pose);
        pilot->begun = 1;
    }
    gbt_origin_place(pilot, pose, state.pose);
    state.time = time;
    state.heading_std = gbt_sqrt(variance);
    gbt_earth_rates(state.pose, velocity, state.rates);
    const gbt_received word = gbt_own_add(&pilot->own, &state, pilot->now);
    if (word == GBT_TAKEN) gbt_origin_follow(pilot);
    return answered(pilot, word);
}

gbt_received gbt_pilot_navigate(gbt_pilot *pilot, double time, const gbt_real *pose, const gbt_real *velocity,
                                const gbt_real *covariance)
{
    double far[GBT_POSE];
    for (int j = 0; j < GBT_POSE; j++) far[j] = (double)pose[j];
    return gbt_pilot_navigate_far(pilot, time, far, velocity, covariance);
}

/* Gives a measurement its place in the earth frame, where the own state is known. */
static gbt_received place(gbt_pilot *pilot, gbt_measurement *measurement)
{
    const int number = measurement->sensor.sensor;
    gbt_own_state own;
    gbt_sighting sighting;
    if (!pilot->begun || !gbt_own_at(&pilot->own, measurement->time, 0, &own)) return GBT_NO_NAVIGATION;
    if (number >= 0 && number < GBT_LISTED) {
        gbt_complete(&gbt_listed_sensors[number], measurement);
        own.heading_std = gbt_fmax(own.heading_std, gbt_listed_sensors[number].heading_std);
    }
    gbt_place_sighting(measurement, own.pose, own.heading_std, &sighting);
    if (measurement->kind == GBT_POSITION && measurement->sensor.frame != GBT_BOW) gbt_origin_take(pilot, sighting.value);
    if (!gbt_intake_add(&pilot->intake, &sighting)) return GBT_FULL;
    if (pilot->decided) gbt_watch_see(&pilot->watch, &pilot->forecast, &sighting);
    return sighting.time < pilot->intake.latest ? GBT_LATE : GBT_TAKEN;
}

/* Whether a measurement is known; those that are too old to come again are forgotten, and in need the oldest one. */
static int is_known(gbt_pilot *pilot, gbt_kind kind, int sensor, double time, double now)
{
    int rest = 0, oldest = 0;
    for (int k = 0; k < pilot->known; k++)
        if (pilot->known_ones[k].time == time && pilot->known_ones[k].kind == kind &&
            pilot->known_ones[k].sensor == sensor)
            return 1;
    for (int k = 0; k < pilot->known; k++)
        if (pilot->known_ones[k].time >= now - gbt_pilot_numbers.late) pilot->known_ones[rest++] = pilot->known_ones[k];
    for (int k = 0; k < rest; k++)
        if (pilot->known_ones[k].time < pilot->known_ones[oldest].time) oldest = k;
    pilot->known = rest < GBT_KNOWN ? rest + 1 : GBT_KNOWN;
    const int free = rest < GBT_KNOWN ? rest : oldest;
    pilot->known_ones[free].sensor = sensor;
    pilot->known_ones[free].kind = kind;
    pilot->known_ones[free].time = time;
    return 0;
}

/* A measurement from what was given; GBT_TAKEN if it is one. */
static gbt_received checked(gbt_kind kind, const gbt_real *value, const gbt_real *sigma, const gbt_sensor_pose *sensor,
                            double time, gbt_measurement *measurement)
{
    *measurement = (gbt_measurement){0};
    if ((unsigned)kind > GBT_POSITION) return GBT_WRONG; /* enums may be signed or not */
    measurement->kind = kind;
    measurement->time = time;
    measurement->stated = sigma != 0;
    if (sensor) {
        if (sensor->sensor < 0 || sensor->sensor >= GBT_SENSORS) return GBT_WRONG;
        if ((unsigned)sensor->frame > GBT_BOW) return GBT_WRONG;
        if (sensor->mounted && !(gbt_finite(sensor->position, D) && isfinite(sensor->yaw))) return GBT_NO_NUMBER;
        measurement->sensor = *sensor;
    }
    if (!isfinite(time) || !gbt_finite(value, gbt_components(kind))) return GBT_NO_NUMBER;
    for (int k = 0; k < gbt_components(kind); k++) {
        measurement->value[k] = value[k];
        if (!sigma) continue;
        if (!isfinite(sigma[k])) return GBT_NO_NUMBER;
        if (!(sigma[k] > 0)) return GBT_WRONG;
        measurement->std[k] = sigma[k];
    }
    return GBT_TAKEN;
}

gbt_received gbt_pilot_measure(gbt_pilot *pilot, gbt_kind kind, const gbt_real *value, const gbt_real *sigma,
                               const gbt_sensor_pose *sensor, double time)
{
    const gbt_pilot_settings *numbers = &gbt_pilot_numbers;
    gbt_measurement measurement;
    const gbt_received fault = checked(kind, value, sigma, sensor, time, &measurement);
    if (fault != GBT_TAKEN) return answered(pilot, fault);
    const double now = gbt_latest(pilot) ? fmax(pilot->now, gbt_latest(pilot)->time) : pilot->now;
    if (time < now - numbers->late) return answered(pilot, GBT_TOO_OLD);
    if (time > now + fmax(numbers->late, numbers->navigation_gap) && now > -HUGE_VAL)
        return answered(pilot, GBT_AHEAD_OF_ALL);
    const int covered = gbt_own_covers(&pilot->own, time);
    if (covered ? pilot->intake.arrived >= GBT_MEASUREMENTS : pilot->waiting >= GBT_MEASUREMENTS)
        return answered(pilot, GBT_FULL);
    if (is_known(pilot, kind, measurement.sensor.sensor, time, now)) return answered(pilot, GBT_DUPLICATE);
    if (!covered) {
        pilot->waiting_ones[pilot->waiting++] = measurement;
        return answered(pilot, GBT_WAITING);
    }
    return answered(pilot, place(pilot, &measurement));
}

/* ---- commands ---- */

/* Gives the tracker all measurements whose place is known. */
static void settle(gbt_pilot *pilot, double time)
{
    int still = 0;
    for (int k = 0; k < pilot->waiting; k++) {
        gbt_measurement *one = &pilot->waiting_ones[k];
        if (gbt_own_covers(&pilot->own, one->time)) {
            const gbt_received word = place(pilot, one);
            if (word == GBT_NO_NAVIGATION || word == GBT_FULL) answered(pilot, word);
        } else if (one->time < time - gbt_pilot_numbers.late) {
            answered(pilot, GBT_NO_NAVIGATION);
        } else {
            pilot->waiting_ones[still++] = *one;
        }
    }
    pilot->waiting = still;
    gbt_tracker_work *work = &pilot->guidance.room.tracking.work;
    pilot->received[GBT_REFUSED] += (unsigned)gbt_intake_settle(&pilot->intake, &pilot->tracker, work);
}

#if !GBT_SHOOTING
/* Seconds since the last command. */
static gbt_real since_last(const gbt_pilot *pilot, const gbt_command *command)
{
    return pilot->commanded ? (gbt_real)(command->time - pilot->last.time) : 0;
}

/* For the wanted thrust, of thrusters whose lag is known. */
static void ask(gbt_pilot *pilot, double hold, gbt_command *command)
{
    gbt_thrusters_ask(&pilot->guidance.thrusters, since_last(pilot, command), (gbt_real)hold, command->thrust);
}

/* Learns what the vehicle needs beyond its model. */
static void observe(gbt_pilot *pilot, const gbt_real *z, const gbt_real *through, const gbt_command *command)
{
    const gbt_real passed = since_last(pilot, command);
    gbt_real acted[GBT_INPUTS];
    gbt_thrusters_acted(&pilot->guidance.thrusters, passed, acted);
    gbt_disturbance_observe(&pilot->guidance.disturbance, z, through, acted, passed);
}
#endif

/* The thrust of the decision, and the setpoint of its plan. */
static void follow(gbt_pilot *pilot, double hold, const gbt_real *z, const gbt_real *dz, gbt_command *command)
{
    gbt_guidance *guidance = &pilot->guidance;
    const double now = guidance->elapsed + (command->time - pilot->decided_at);
    if (!pilot->following) {
        for (int i = 0; i < GBT_INPUTS; i++) command->thrust[i] = guidance->thrust[i];
#if !GBT_SHOOTING
        guidance->disturbance.known = 0;
        ask(pilot, hold, command);
#endif
        return;
    }
#if GBT_SHOOTING
    (void)hold;
    gbt_regulator_inputs(&guidance->regulator, now, z, dz, command->thrust);
#else
    gbt_follow_result followed;
    gbt_real at[GBT_ORDERS][GBT_FLAT], later[GBT_ORDERS][GBT_FLAT], own[GBT_FLAT], through[2][GBT_FLAT], water[D];
    gbt_trajectory_at(&guidance->follower, now, at);
    gbt_trajectory_at(&guidance->follower, now + hold / 2, later);
    for (int j = 0; j < GBT_FLAT; j++) {
        /* plan and vehicle are compared in the frame of the water */
        through[0][j] = z[j] - (gbt_real)now * gbt_water(pilot, j);
        through[1][j] = dz[j] - gbt_water(pilot, j);
        own[j] = j < D ? through[0][j] - guidance->follower.start[0][j] : z[j];
        if (j < D) water[j] = gbt_water(pilot, j);
    }
    if (gbt_pilot_numbers.observing) observe(pilot, z, through[1], command);
    gbt_follow_points(guidance->follower.bandwidth, &at[0][0], &later[0][0], own, through[0], through[1],
                      gbt_pilot_numbers.observing ? guidance->disturbance.estimate : 0, &followed);
    for (int i = 0; i < GBT_INPUTS; i++) command->thrust[i] = followed.thrust[i];
    ask(pilot, hold, command);
    gbt_follow_setpoint(&guidance->follower, (gbt_real)(now + gbt_pilot_numbers.lead), water, &command->setpoint);
    gbt_origin_give(pilot, command->setpoint.z);
#endif
}

static void report(const gbt_pilot *pilot, double time, gbt_command *command)
{
    const gbt_own_state *last = gbt_latest(pilot);
    const gbt_plan_result *plan = &pilot->guidance.plan;
    int given_up = 0;
    command->planned = pilot->planned;
    command->planner = plan->status;
    command->origin = plan->origin;
    for (int q = 0; q < GBT_LIMITS; q++) given_up = given_up || plan->given_up[q] > 0;
    command->bearing_age = time - pilot->intake.latest;
    command->navigation_age = last ? fmax(0, time - last->time) : HUGE_VAL;
    command->track_lost = gbt_watch_lost(&pilot->watch);
    command->waiting = pilot->waiting;
    command->new_tracks = pilot->intake.begun;
    for (int k = 0; k < GBT_ANSWERS; k++) command->received[k] = pilot->received[k];
    command->notes = pilot->decided ? 0 : GBT_NOTE_NO_NAVIGATION;
    if (last && command->navigation_age > gbt_pilot_numbers.navigation_gap) command->notes |= GBT_NOTE_NAVIGATION_OLD;
    if (isinf(pilot->intake.latest)) command->notes |= GBT_NOTE_NO_BEARING;
    if (command->track_lost) command->notes |= GBT_NOTE_TRACK_LOST;
    if (pilot->decided && pilot->held) command->notes |= GBT_NOTE_FORECAST_HELD;
    if (pilot->planned && plan->origin != GBT_PLANNED) command->notes |= GBT_NOTE_FALLBACK;
    if (pilot->planned && given_up) command->notes |= GBT_NOTE_GIVEN_UP;
}

gbt_command_status gbt_pilot_command(gbt_pilot *pilot, double time, gbt_command *command)
{
    const double period = gbt_pilot_numbers.period;
    gbt_own_state own;
    gbt_real z[GBT_FLAT], dz[GBT_FLAT];
    if (pilot->commanded && time <= pilot->last.time) {
        *command = pilot->last;
        if (time < pilot->last.time) command->notes |= GBT_NOTE_STEPPED_BACK;
        return command->status = GBT_COMMAND_AGAIN;
    }
    *command = (gbt_command){0};
    command->time = time;
    command->setpoint.status = GBT_FOLLOW_NO_PLAN;
    if (!isfinite(time)) return command->status = GBT_COMMAND_NOT_FINITE;
    if (!pilot->begun || !gbt_own_at(&pilot->own, time, 1, &own)) {
        report(pilot, time, command);
        return command->status = GBT_COMMAND_BLIND;
    }
    settle(pilot, time);
    const double hold = pilot->commanded ? fmin(time - pilot->last.time, period) : period;
    gbt_carry_on(pilot, &own, time, z, dz);
    if ((!pilot->decided || time + hold / 2 >= pilot->decided_at + period) && !gbt_decide(pilot, time, z, dz))
        return command->status = GBT_COMMAND_NO_PLAN;
    follow(pilot, hold, z, dz, command);
#if GBT_CURRENT == 2
    gbt_current_command(&pilot->current, time, command->thrust);
#endif
    command->following = pilot->following;
    command->range_known = pilot->range_known;
    pilot->now = time;
    report(pilot, time, command);
    command->status = GBT_COMMANDED;
    pilot->last = *command;
    pilot->commanded = 1;
    return GBT_COMMANDED;
}
