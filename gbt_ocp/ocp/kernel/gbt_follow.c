#include "gbt_follow.h"

#include "gbt_math.h"
#include "gbt_pieces.h"
#include "gbt_thrust.h"

#define SAME_TIME (8 * GBT_EPSILON * GBT_PIECES) /* rounding of a time, in pieces: a boundary belongs to the later one */

#define QUICKER ((gbt_real)0.1) /* share of a lag within which a thrust is to act */

#define TURN_FACTOR 4                /* of an angle, the bandwidth is so many times that of the position, */
#define TURN_BANDWIDTH ((gbt_real)8) /* up to this, rad/s */
#define TURN_SHARE ((gbt_real)0.7)   /* of its limits that an input may take to turn before the vehicle is slowed down */
#define PROBE ((gbt_real)0.1)        /* half a difference of velocities from which slopes are taken, m/s */

void gbt_thrusters_init(gbt_thrusters *thrusters, gbt_real lag)
{
    thrusters->lag = lag;
    for (int i = 0; i < GBT_INPUTS; i++) thrusters->asked[i] = thrusters->acting[i] = 0;
}

void gbt_thrusters_ask(gbt_thrusters *thrusters, gbt_real passed, gbt_real hold, gbt_real *thrust)
{
    if (!(thrusters->lag > 0)) {
        for (int i = 0; i < GBT_INPUTS; i++) thrusters->asked[i] = thrust[i];
        return;
    }
    const gbt_real left = gbt_exp(-passed / thrusters->lag);
    const gbt_real within = 1 - gbt_exp(-gbt_fmax(hold / thrusters->lag, QUICKER));
    for (int i = 0; i < GBT_INPUTS; i++) {
        const gbt_real asked = thrusters->asked[i], acting = asked + (thrusters->acting[i] - asked) * left;
        thrusters->acting[i] = acting;
        thrust[i] = thrusters->asked[i] = gbt_within_thrust(i, acting + (thrust[i] - acting) / within, 1);
    }
}

void gbt_thrusters_acted(const gbt_thrusters *thrusters, gbt_real passed, gbt_real *acted)
{
    const gbt_real lag = thrusters->lag;
    const gbt_real share = lag > 0 && passed > 0 ? -gbt_expm1(-passed / lag) * lag / passed : 0;
    for (int i = 0; i < GBT_INPUTS; i++)
        acted[i] = thrusters->asked[i] + share * (thrusters->acting[i] - thrusters->asked[i]);
}

#define ESTIMATED_IN ((gbt_real)0.3) /* time constant of the estimate, s */
#define LONGEST ((gbt_real)0.5)      /* between two samples from which an acceleration is taken, s */
#define MOST ((gbt_real)0.5)         /* share of the limits within which the estimate is kept */

void gbt_disturbance_init(gbt_disturbance *disturbance)
{
    disturbance->known = 0;
    for (int i = 0; i < GBT_INPUTS; i++) disturbance->estimate[i] = 0;
}

void gbt_disturbance_observe(gbt_disturbance *disturbance, const gbt_real *z, const gbt_real *dz, const gbt_real *acted,
                             gbt_real passed)
{
    gbt_real point[GBT_POINT], needed[GBT_INPUTS];
    int finite = disturbance->known && passed > 0 && passed <= LONGEST;
    for (int a = 0; a < GBT_POINT; a++) point[a] = 0;
    for (int j = 0; j < GBT_FLAT; j++) {
        /* of the angles, the middle of the step: no vehicle cares so exactly where it is */
        const gbt_real turned = j < GBT_DIMENSION ? 0 : gbt_remainder(z[j] - disturbance->z[j], GBT_TURN);
        point[j] = z[j] - turned / 2;
        point[GBT_FLAT + j] = (disturbance->dz[j] + dz[j]) / 2;
        point[2 * GBT_FLAT + j] = (dz[j] - disturbance->dz[j]) / passed;
        disturbance->z[j] = z[j];
        disturbance->dz[j] = dz[j];
    }
    disturbance->known = 1;
    if (!finite) return;
    gbt_vehicle_inputs(point, 0, 0, needed);
    for (int i = 0; i < GBT_INPUTS; i++)
        if (!isfinite(acted[i] - needed[i])) return;
    const gbt_real share = 1 - gbt_exp(-passed / ESTIMATED_IN);
    for (int i = 0; i < GBT_INPUTS; i++) {
        const gbt_real old = disturbance->estimate[i];
        disturbance->estimate[i] = gbt_within_thrust(i, old + share * (acted[i] - needed[i] - old), MOST);
    }
}

void gbt_follow_init(gbt_follower *follower, gbt_real bandwidth)
{
    follower->bandwidth = bandwidth;
    follower->planned = 0;
}

void gbt_follow_plan(gbt_follower *follower, const gbt_real *state, const gbt_real *top)
{
    for (int a = 0; a < GBT_MOTION; a++) follower->start[a / GBT_FLAT][a % GBT_FLAT] = state[a];
    for (int a = 0; a < GBT_PIECES * GBT_FREE; a++) follower->top[a / GBT_FREE][a % GBT_FREE] = top[a];
    follower->planned = 1;
}

/* The piece in which a time lies, its position relative to the start, and what has elapsed of it; 0 if the time lies
   beyond the plan. */
static int piece_at(const gbt_follower *follower, gbt_real elapsed, gbt_real piece[GBT_ORDERS][GBT_FLAT], gbt_real *s)
{
    const gbt_real pieces = elapsed / GBT_PERIOD + SAME_TIME;
    if (!follower->planned || pieces < 0 || pieces > GBT_PIECES + 2 * SAME_TIME) return 0;
    const int number = pieces < GBT_PIECES ? (int)pieces : GBT_PIECES - 1;
    for (int l = 0; l < GBT_JOINED + GBT_REMEMBERED; l++)
        for (int j = 0; j < GBT_FLAT; j++)
            piece[l][j] = l == GBT_JOINED || (l == 0 && j < GBT_DIMENSION) ? 0 : follower->start[l][j];
    for (int i = 0;; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = follower->top[i][a];
        if (i == number) break;
        gbt_next_piece(piece, piece);
    }
    *s = elapsed - (gbt_real)number * GBT_PERIOD;
    return 1;
}

static gbt_follow_status idle(gbt_follow_status status, gbt_follow_result *result)
{
    for (int i = 0; i < GBT_INPUTS; i++) result->thrust[i] = 0;
    for (int j = 0; j < GBT_FLAT; j++) result->error[j] = 0;
    result->off_plan = 0;
    return result->status = status;
}

/* The thrust of a point, and what is added to it. */
static void ask(const gbt_real *point, const gbt_real *beyond, gbt_real *thrust)
{
    gbt_vehicle_inputs(point, 0, 0, thrust);
    for (int i = 0; beyond && i < GBT_INPUTS; i++) thrust[i] += beyond[i];
}

#if GBT_INPUTS == GBT_FLAT
/* What an input that turns is asked beyond its share and beyond the plan. */
static gbt_real excess_of(int i, gbt_real asked, gbt_real planned)
{
    const gbt_real least = gbt_fmin(TURN_SHARE * gbt_thrust_min[i], planned);
    const gbt_real most = gbt_fmax(TURN_SHARE * gbt_thrust_max[i], planned);
    return asked > most ? asked - most : asked < least ? asked - least : 0;
}

/* Adds to the acceleration of a point what takes off the velocity of which turning needs so much, at most all of it,
   where the inputs that turn are asked more than their share and more than planned. Returns whether any is. */
static int slow_down(gbt_real turn, const gbt_real *middle, const gbt_real *asked, gbt_real *point)
{
    gbt_real excess[GBT_FLAT], planned[GBT_INPUTS], more[GBT_INPUTS], less[GBT_INPUTS], slopes[GBT_FLAT][GBT_DIMENSION];
    gbt_real speed = 0;
    int any = 0;
    for (int i = GBT_DIMENSION; i < GBT_FLAT; i++) any = any || gbt_within_thrust(i, asked[i], TURN_SHARE) != asked[i];
    if (!any) return 0;
    gbt_vehicle_inputs(middle, 0, 0, planned);
    for (int i = GBT_DIMENSION; i < GBT_FLAT; i++) excess[i] = excess_of(i, asked[i], planned[i]);
    for (int j = 0; j < GBT_DIMENSION; j++) {
        gbt_real *rate = &point[GBT_FLAT + j];
        const gbt_real before = *rate;
        speed += before * before;
        *rate = before + PROBE;
        gbt_vehicle_inputs(point, 0, 0, more);
        *rate = before - PROBE;
        gbt_vehicle_inputs(point, 0, 0, less);
        *rate = before;
        for (int i = GBT_DIMENSION; i < GBT_FLAT; i++) slopes[i][j] = (more[i] - less[i]) / (2 * PROBE);
    }
    speed = gbt_sqrt(speed);
    for (int i = GBT_DIMENSION; i < GBT_FLAT; i++) {
        gbt_real size = 0;
        for (int j = 0; j < GBT_DIMENSION; j++) size += slopes[i][j] * slopes[i][j];
        size = gbt_sqrt(size);
        if (!(size > 0) || excess[i] == 0) continue;
        const gbt_real change = gbt_fmin(gbt_fabs(excess[i]) / size, speed);
        for (int j = 0; j < GBT_DIMENSION; j++)
            point[2 * GBT_FLAT + j] -= turn * (excess[i] > 0 ? change : -change) * slopes[i][j] / size;
    }
    return 1;
}
#endif

gbt_follow_status gbt_follow_points(gbt_real bandwidth, const gbt_real *now, const gbt_real *middle, const gbt_real *own,
                                    const gbt_real *z, const gbt_real *dz, const gbt_real *beyond,
                                    gbt_follow_result *result)
{
    gbt_real point[GBT_POINT], square = 0;
    const gbt_real turn = gbt_fmax(bandwidth, gbt_fmin(TURN_FACTOR * bandwidth, TURN_BANDWIDTH));
    for (int j = 0; j < GBT_FLAT; j++) {
        const gbt_real error = now[j] - own[j], rate_error = now[GBT_FLAT + j] - dz[j];
        const gbt_real w = j < GBT_DIMENSION ? bandwidth : turn;
        result->error[j] = j < GBT_DIMENSION ? error : gbt_remainder(error, GBT_TURN);
        if (j < GBT_DIMENSION) square += error * error;
        point[j] = z[j] + (middle[j] - now[j]);
        point[GBT_FLAT + j] = dz[j] + (middle[GBT_FLAT + j] - now[GBT_FLAT + j]);
        point[2 * GBT_FLAT + j] = middle[2 * GBT_FLAT + j] + 2 * w * rate_error + w * w * result->error[j];
    }
    result->off_plan = gbt_sqrt(square);
    result->status = GBT_FOLLOWED;
    ask(point, beyond, result->thrust);
#if GBT_INPUTS == GBT_FLAT
    if (slow_down(turn, middle, result->thrust, point)) ask(point, beyond, result->thrust);
#endif
    for (int i = 0; i < GBT_INPUTS; i++) {
        const gbt_real asked = result->thrust[i];
        if (!isfinite(asked)) return idle(GBT_FOLLOW_NOT_FINITE, result);
        result->thrust[i] = gbt_within_thrust(i, asked, 1);
        if (result->thrust[i] != asked) result->status = GBT_FOLLOW_CLIPPED;
    }
    return result->status;
}

gbt_follow_status gbt_follow(const gbt_follower *follower, gbt_real elapsed, gbt_real hold, const gbt_real *z,
                             const gbt_real *dz, gbt_follow_result *result)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], now[GBT_POINT], middle[GBT_POINT], own[GBT_FLAT], s;
    int finite = isfinite(elapsed) && isfinite(hold);
    for (int j = 0; j < GBT_FLAT; j++) finite = finite && isfinite(z[j]) && isfinite(dz[j]);
    if (!finite) return idle(GBT_FOLLOW_NOT_FINITE, result);
    if (!piece_at(follower, elapsed, piece, &s)) return idle(GBT_FOLLOW_NO_PLAN, result);
    gbt_point_after(piece, s, now);
    gbt_point_after(piece, s + hold / 2, middle);
    for (int j = 0; j < GBT_FLAT; j++) own[j] = j < GBT_DIMENSION ? z[j] - follower->start[0][j] : z[j];
    return gbt_follow_points(follower->bandwidth, now, middle, own, z, dz, 0, result);
}

gbt_follow_status gbt_follow_setpoint(const gbt_follower *follower, gbt_real ahead, const gbt_real *water,
                                      gbt_setpoint *setpoint)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], point[GBT_POINT], s;
    int finite = isfinite(ahead);
    for (int j = 0; water && j < GBT_DIMENSION; j++) finite = finite && isfinite(water[j]);
    *setpoint = (gbt_setpoint){0};
    if (!finite) return setpoint->status = GBT_FOLLOW_NOT_FINITE;
    if (ahead > GBT_PIECES * GBT_PERIOD) ahead = GBT_PIECES * GBT_PERIOD;
    if (!piece_at(follower, ahead, piece, &s)) return setpoint->status = GBT_FOLLOW_NO_PLAN;
    gbt_point_after(piece, s, point);
    setpoint->speed = gbt_sqrt(point[GBT_FLAT] * point[GBT_FLAT] + point[GBT_FLAT + 1] * point[GBT_FLAT + 1]);
    for (int j = 0; j < GBT_FLAT; j++) {
        const gbt_real flow = water && j < GBT_DIMENSION ? water[j] : 0;
        setpoint->z[j] = point[j] + (j < GBT_DIMENSION ? follower->start[0][j] + flow * ahead : 0);
        setpoint->dz[j] = point[GBT_FLAT + j] + flow;
    }
    setpoint->course = gbt_atan2(setpoint->dz[1], setpoint->dz[0]);
#if GBT_FLAT > GBT_DIMENSION
    setpoint->heading = setpoint->z[GBT_DIMENSION];
#endif
#if GBT_DIMENSION == 3
    setpoint->depth = -setpoint->z[2];
#endif
    return setpoint->status = GBT_FOLLOWED;
}
