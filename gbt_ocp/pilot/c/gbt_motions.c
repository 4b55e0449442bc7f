#include "gbt_motions.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_COORDINATES
#define KNOT_OF_SLOW (GBT_SLOWER * GBT_KNOT_NODES) /* nodes of a slow knot */

/* ---- coordinates and knots ---- */

/* The coordinate of a knot of the turn rate, and of one of log speed or climb angle, from 1; those ahead behind the others. */
static int fast_at(int knot)
{
    if (knot < GBT_FAST) return knot == 0 ? GBT_HEADS : GBT_HEADS + 1 + (knot - 1) / 2 * GBT_EACH + (knot - 1) % 2;
    return N + (knot - GBT_FAST) / 2 * GBT_EACH + (knot - GBT_FAST) % 2;
}

static int slow_at(int knot, int climb)
{
    if (knot <= GBT_SLOW) return GBT_HEADS + 1 + (knot - 1) * GBT_EACH + GBT_SLOWER + climb;
    return N + (knot - 1 - GBT_SLOW) * GBT_EACH + GBT_SLOWER + climb;
}

/* The row of a factor that belongs to a knot along a course, counted from now; -1 of a process that is zero now. */
static int fast_row(int ahead, int knot) { return ahead && knot > 0 ? GBT_FAST - 1 + knot : knot; }
static int slow_row(int ahead, int knot) { return knot == 0 ? -1 : ahead ? GBT_SLOW - 1 + knot : knot - 1; }

static const gbt_real *turn_factor(const gbt_shape_prior *prior, int point)
{
    return prior->turn_factor[point / GBT_SPEED_STDS % GBT_TURN_TIMES];
}
static gbt_real turn_std(const gbt_shape_prior *prior, int point)
{
    return prior->turn_std[point / GBT_SPEED_STDS / GBT_TURN_TIMES];
}
static gbt_real speed_std(const gbt_shape_prior *prior, int point) { return prior->speed_std[point % GBT_SPEED_STDS]; }

/* A process at a knot along a course: of the turn rate, or of log speed or climb angle at unit deviation. */
static gbt_real turn_rate(const gbt_shape_prior *prior, const gbt_motion *motion, int ahead, int knot)
{
    const int row = fast_row(ahead, knot);
    const gbt_real *factor = &turn_factor(prior, motion->point)[GBT_ROW_BEGIN(row)];
    gbt_real sum = 0;
    for (int m = 0; m <= row && m < GBT_FAST; m++) sum += factor[m] * motion->white[fast_at(m)];
    return turn_std(prior, motion->point) * sum;
}

static gbt_real slow_change(const gbt_real *factor, const gbt_motion *motion, int ahead, int knot, int climb)
{
    const int row = slow_row(ahead, knot);
    gbt_real sum = 0;
    for (int m = 0; m <= row && m < GBT_SLOW; m++) sum += factor[GBT_ROW_BEGIN(row) + m] * motion->white[slow_at(m + 1, climb)];
    return sum;
}

static int knots_of(int ahead) { return ahead ? GBT_BLOCKS : GBT_SLOW; }

double gbt_longest_ahead(const gbt_shape_prior *prior) { return GBT_BLOCKS * GBT_SLOWER * prior->knot; }

/* ---- along a course ---- */

/* Velocity at the node, from what the processes are there. */
static void velocity_at(gbt_course *course, const gbt_shape_prior *prior, const gbt_motion *motion)
{
    const int slow = course->node / KNOT_OF_SLOW;
    const gbt_real share = (gbt_real)(course->node % KNOT_OF_SLOW) / KNOT_OF_SLOW, rest = 1 - share;
    const int next = share > 0 ? slow + 1 : slow;
    const gbt_real heading = motion->heading + course->turned;
    course->pace = prior->log_speed_std * motion->white[GBT_SPEED_AT] + rest * course->faster[slow] + share * course->faster[next];
    course->speed = prior->speed * gbt_exp(course->pace);
    course->velocity[0] = course->speed * gbt_cos(heading);
    course->velocity[1] = course->speed * gbt_sin(heading);
#if GBT_DIMENSION == 3
    const gbt_real change = rest * course->steeper[slow] + share * course->steeper[next];
    const gbt_real climb = prior->climb_std * motion->white[GBT_CLIMB_AT] + change;
    const gbt_real cosine = gbt_cos(climb), sine = gbt_sin(climb);
    for (int k = 0; k < 2; k++) {
        course->raised[k] = -sine * course->velocity[k];
        course->velocity[k] *= cosine;
    }
    course->raised[2] = cosine * course->speed;
    course->velocity[2] = sine * course->speed;
#endif
}

/* Slopes of the velocity by the coordinates of a process that is slow, of which `along` is the slope by its value. */
static void slow_slopes(const gbt_course *course, const gbt_real *factor, gbt_real deviation, const gbt_real *along,
                        int climb, gbt_real rates[D][N + GBT_BEYOND])
{
    const int slow = course->node / KNOT_OF_SLOW;
    const gbt_real share = (gbt_real)(course->node % KNOT_OF_SLOW) / KNOT_OF_SLOW;
    const int row = slow_row(course->ahead, slow), after = share > 0 ? slow_row(course->ahead, slow + 1) : row;
    for (int m = 0; m <= after || m <= row; m++) {
        const gbt_real first = m <= row ? factor[GBT_ROW_BEGIN(row) + m] : 0;
        const gbt_real value = share > 0 ? (1 - share) * first + share * factor[GBT_ROW_BEGIN(after) + m] : first;
        for (int i = 0; i < D; i++) rates[i][slow_at(m + 1, climb)] = along[i] * (deviation * value);
    }
}

/* Slopes of the velocity at the node by all coordinates. */
static void rates_at(const gbt_course *course, gbt_slopes *slopes, const gbt_shape_prior *prior, const gbt_motion *motion,
                     int knots)
{
    const gbt_real across[3] = {-course->velocity[1], course->velocity[0], 0}, std = turn_std(prior, motion->point);
    for (int i = 0; i < D; i++) {
        slopes->rates[i][GBT_HEADING_AT] = GBT_FLAT_ANGLE * across[i];
        slopes->rates[i][GBT_SPEED_AT] = prior->log_speed_std * course->velocity[i];
    }
    for (int m = 0; m < knots; m++)
        for (int i = 0; i < 2; i++) slopes->rates[i][fast_at(m)] = across[i] * (std * slopes->turn[m]);
    slow_slopes(course, prior->speed_factor, speed_std(prior, motion->point), course->velocity, 0, slopes->rates);
#if GBT_DIMENSION == 3
    for (int i = 0; i < D; i++) slopes->rates[i][GBT_CLIMB_AT] = prior->climb_std * course->raised[i];
    slow_slopes(course, prior->climb_factor, prior->climb_change_std, course->raised, 1, slopes->rates);
#endif
}

/* Slopes of the turn rate at the node by its coordinates; returns how many there are. */
static int turn_row(const gbt_course *course, const gbt_real *factor, gbt_real *row)
{
    const int knot = course->node / GBT_KNOT_NODES, between = course->node % GBT_KNOT_NODES;
    const gbt_real share = (gbt_real)between / GBT_KNOT_NODES;
    const int first = fast_row(course->ahead, knot), last = between ? fast_row(course->ahead, knot + 1) : first;
    for (int m = 0; m <= last; m++) {
        const gbt_real value = m <= first ? factor[GBT_ROW_BEGIN(first) + m] : 0;
        row[m] = between ? (1 - share) * value + share * factor[GBT_ROW_BEGIN(last) + m] : value;
    }
    return last + 1;
}

void gbt_course_begin(gbt_course *course, gbt_slopes *slopes, const gbt_shape_prior *prior, const gbt_motion *motion,
                      int ahead)
{
    const int slow = knots_of(ahead);
    const gbt_real range = prior->range * gbt_exp(prior->log_range_std * motion->white[0]);
    course->ahead = ahead;
    course->node = 0;
    course->step = (gbt_real)(ahead ? prior->knot : -prior->knot) / GBT_KNOT_NODES;
    course->turned = 0;
    for (int k = 0; k <= GBT_SLOWER * slow; k++) course->rate[k] = turn_rate(prior, motion, ahead, k);
    for (int k = 0; k <= slow; k++) {
        course->faster[k] = speed_std(prior, motion->point) * slow_change(prior->speed_factor, motion, ahead, k, 0);
#if GBT_DIMENSION == 3
        course->steeper[k] = prior->climb_change_std * slow_change(prior->climb_factor, motion, ahead, k, 1);
#endif
    }
    for (int i = 0; i < D; i++) course->position[i] = range * motion->direction[i];
    velocity_at(course, prior, motion);
    if (!slopes) return;
    gbt_real basis[GBT_AXES][D];
    *slopes = (gbt_slopes){0};
    gbt_tangent_basis(motion->direction, basis);
    for (int i = 0; i < D; i++) {
        slopes->here[i][0] = prior->log_range_std * course->position[i];
        for (int a = 0; a < GBT_AXES; a++) slopes->here[i][1 + a] = GBT_FLAT_ANGLE * (range * basis[a][i]);
    }
    slopes->active = ahead ? N + GBT_BEYOND : GBT_HEADS + 1;
    const int knots = turn_row(course, turn_factor(prior, motion->point), slopes->row);
    rates_at(course, slopes, prior, motion, knots);
}

void gbt_course_next(gbt_course *course, gbt_slopes *slopes, const gbt_shape_prior *prior, const gbt_motion *motion)
{
    gbt_real before[D];
    const int node = ++course->node;
    const gbt_real half = course->step / 2;
    gbt_real rate[2];
    for (int k = 0; k < 2; k++) {
        const int at = node - 1 + k, left = at / GBT_KNOT_NODES;
        const gbt_real share = (gbt_real)(at % GBT_KNOT_NODES) / GBT_KNOT_NODES;
        rate[k] = share > 0 ? (1 - share) * course->rate[left] + share * course->rate[left + 1] : course->rate[left];
    }
    course->turned += half * (rate[0] + rate[1]);
    for (int i = 0; i < D; i++) before[i] = course->velocity[i];
    velocity_at(course, prior, motion);
    for (int i = 0; i < D; i++) course->position[i] += half * (before[i] + course->velocity[i]);
    if (!slopes) return;
    gbt_real row[GBT_FAST_ALL];
    const int knots = turn_row(course, turn_factor(prior, motion->point), row);
    for (int m = 0; m < knots; m++) {
        slopes->turn[m] += half * (slopes->row[m] + row[m]);
        slopes->row[m] = row[m];
    }
    if (!course->ahead) slopes->active = GBT_HEADS + 1 + (node + KNOT_OF_SLOW - 1) / KNOT_OF_SLOW * GBT_EACH;
    for (int i = 0; i < D; i++)
        for (int j = 0; j < slopes->active; j++) {
            slopes->before[i][j] = slopes->here[i][j];
            slopes->here[i][j] += half * slopes->rates[i][j];
        }
    rates_at(course, slopes, prior, motion, knots);
    for (int i = 0; i < D; i++)
        for (int j = 0; j < slopes->active; j++) slopes->here[i][j] += half * slopes->rates[i][j];
}

/* ---- making motions ---- */

static gbt_real within(gbt_real value, gbt_real most) { return gbt_fmin(gbt_fmax(value, -most), most); }

void gbt_motion_begin(const gbt_shape_prior *prior, int point, gbt_real range, const gbt_real *direction,
                      const gbt_real *velocity, gbt_motion *motion)
{
    const gbt_real speed = gbt_fmax(gbt_length(velocity), (gbt_real)1e-3 * prior->speed);
    for (int j = 0; j < N; j++) motion->white[j] = 0;
    for (int k = 0; k < D; k++) motion->direction[k] = direction[k];
    motion->point = point;
    motion->heading = gbt_atan2(velocity[1], velocity[0]);
    motion->white[0] = gbt_log(range / prior->range) / prior->log_range_std;
    /* a start far out in the tail of the prior does not help */
    motion->white[GBT_SPEED_AT] = within(gbt_log(speed / prior->speed) / prior->log_speed_std, 2);
#if GBT_DIMENSION == 3
    const gbt_real climb = gbt_atan2(velocity[2], gbt_hypot(velocity[0], velocity[1]));
    motion->white[GBT_CLIMB_AT] = within(climb / prior->climb_std, 2);
#endif
}

void gbt_motion_move(const gbt_motion *motion, const gbt_real *step, gbt_motion *moved)
{
    gbt_real angle[GBT_AXES], direction[D];
    for (int a = 0; a < GBT_AXES; a++) angle[a] = GBT_FLAT_ANGLE * (motion->white[1 + a] + step[1 + a]);
    gbt_rotate_bearing(motion->direction, angle, direction);
    moved->heading = motion->heading + GBT_FLAT_ANGLE * (motion->white[GBT_HEADING_AT] + step[GBT_HEADING_AT]);
    moved->point = motion->point;
    for (int k = 0; k < D; k++) moved->direction[k] = direction[k];
    for (int j = 0; j < N; j++) moved->white[j] = motion->white[j] + step[j];
    for (int a = 0; a < GBT_AXES; a++) moved->white[1 + a] = 0;
    moved->white[GBT_HEADING_AT] = 0;
}

/* Coordinates of values of a process at its knots, in their places: what gives them by the factor. */
static void whiten(const gbt_real *factor, gbt_real *values, int count, gbt_real deviation)
{
    for (int i = 0; i < count; i++) {
        gbt_real rest = values[i] / deviation;
        for (int m = 0; m < i; m++) rest -= factor[GBT_ROW_BEGIN(i) + m] * values[m];
        values[i] = rest / factor[GBT_ROW_BEGIN(i) + i];
    }
}

static void set_turn(const gbt_shape_prior *prior, gbt_real *rate, gbt_motion *motion)
{
    whiten(turn_factor(prior, motion->point), rate, GBT_FAST, turn_std(prior, motion->point));
    for (int m = 0; m < GBT_FAST; m++) motion->white[fast_at(m)] = rate[m];
}

static void set_slow(const gbt_real *factor, gbt_real deviation, gbt_real *change, int climb, gbt_motion *motion)
{
    whiten(factor, change, GBT_SLOW, deviation);
    for (int m = 0; m < GBT_SLOW; m++) motion->white[slow_at(m + 1, climb)] = change[m];
}

/* A value at a time in units of the knots of a process, ahead above 0, held beyond the last knots. */
static gbt_real at_knot(const gbt_real *past, int most_past, const gbt_real *ahead, int most_ahead,
                        gbt_real place)
{
    const gbt_real *values = place > 0 ? ahead : past;
    const int most = place > 0 ? most_ahead : most_past;
    const gbt_real far = gbt_fmin(gbt_fabs(place), (gbt_real)most);
    const int left = far < (gbt_real)most ? (int)far : most - 1;
    const gbt_real share = far - (gbt_real)left;
    return (1 - share) * values[left] + share * values[left + 1];
}

void gbt_motion_advance(const gbt_shape_prior *prior, const gbt_motion *motion, double seconds, const gbt_real *own,
                        gbt_motion *later)
{
    gbt_course past, ahead;
    gbt_real rate[GBT_FAST], change[GBT_SLOW], place[D], now, turned, before_turned = 0, before[D];
    const gbt_real fast = (gbt_real)(seconds / prior->knot), slow = fast / GBT_SLOWER, node = fast * GBT_KNOT_NODES;
    const gbt_real reached = gbt_fmin(node, GBT_NODES_AHEAD - 1);
    const int left = reached < GBT_NODES_AHEAD - 1 ? (int)reached : GBT_NODES_AHEAD - 2;
    const gbt_real share = reached - (gbt_real)left;
    gbt_course_begin(&past, 0, prior, motion, 0);
    gbt_course_begin(&ahead, 0, prior, motion, 1);
    while (ahead.node <= left) {
        before_turned = ahead.turned;
        for (int k = 0; k < D; k++) before[k] = ahead.position[k];
        gbt_course_next(&ahead, 0, prior, motion);
    }
    turned = (1 - share) * before_turned + share * ahead.turned;
    for (int k = 0; k < D; k++) {
        place[k] = (1 - share) * before[k] + share * ahead.position[k] - own[k];
        /* beyond what is computed straight on; the processes keep the values that they have reached */
        if (node > reached) place[k] += (gbt_real)(seconds - gbt_longest_ahead(prior)) * ahead.velocity[k];
    }
    const gbt_real range = gbt_fmax(gbt_length(place), (gbt_real)1e-6);
    later->point = motion->point;
    later->heading = motion->heading + turned;
    for (int k = 0; k < D; k++) later->direction[k] = place[k] / range;
    for (int j = 0; j < GBT_HEADS; j++) later->white[j] = 0;
    later->white[0] = gbt_log(range / prior->range) / prior->log_range_std;
    for (int k = 0; k < GBT_FAST; k++)
        rate[k] = at_knot(past.rate, GBT_FAST - 1, ahead.rate, GBT_SLOWER * GBT_BLOCKS, fast - (gbt_real)k);
    set_turn(prior, rate, later);
    now = at_knot(past.faster, GBT_SLOW, ahead.faster, GBT_BLOCKS, slow);
    for (int k = 1; k <= GBT_SLOW; k++)
        change[k - 1] = at_knot(past.faster, GBT_SLOW, ahead.faster, GBT_BLOCKS, slow - (gbt_real)k) - now;
    later->white[GBT_SPEED_AT] = motion->white[GBT_SPEED_AT] + now / prior->log_speed_std;
    set_slow(prior->speed_factor, speed_std(prior, motion->point), change, 0, later);
#if GBT_DIMENSION == 3
    now = at_knot(past.steeper, GBT_SLOW, ahead.steeper, GBT_BLOCKS, slow);
    for (int k = 1; k <= GBT_SLOW; k++)
        change[k - 1] = at_knot(past.steeper, GBT_SLOW, ahead.steeper, GBT_BLOCKS, slow - (gbt_real)k) - now;
    later->white[GBT_CLIMB_AT] = motion->white[GBT_CLIMB_AT] + now / prior->climb_std;
    set_slow(prior->climb_factor, prior->climb_change_std, change, 1, later);
#endif
}

void gbt_motion_transfer(const gbt_shape_prior *prior, const gbt_motion *motion, int point, gbt_motion *other)
{
    gbt_course past;
    gbt_course_begin(&past, 0, prior, motion, 0);
    *other = *motion;
    other->point = point;
    set_turn(prior, past.rate, other);
    set_slow(prior->speed_factor, speed_std(prior, point), &past.faster[1], 0, other);
#if GBT_DIMENSION == 3
    set_slow(prior->climb_factor, prior->climb_change_std, &past.steeper[1], 1, other);
#endif
}
