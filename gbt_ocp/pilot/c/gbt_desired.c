#include "gbt_desired.h"

#include "gbt_bearing.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define LEAST_ACROSS 0.3 /* part of the speed that goes across the line of sight, however fast the target is */
#define NEAREST 1e-9     /* distance in metres below which a line of sight turns no faster */
#define WITHIN 1e-9      /* part of a piece nearer than which to its ends a reversal counts as at an end */
#define CIRCLE (D == 2 ? 1.0 : sqrt(6.0) / 3.0) /* radius of the circle; in space it is lifted along the axis */

/* Seconds of turning at a time: those forth less those back. */
static double turned_at(const gbt_desired *desired, double time)
{
    if (!(desired->reverse > 0)) return time;
    const double lap = 2 * desired->reverse;
    double into = fmod(time - desired->leg_start, lap);
    if (into < 0) into += lap;
    return fmin(into, lap - into);
}

/* Seconds of turning since the last change of pace. */
static double since(const gbt_desired *desired, double time)
{
    return turned_at(desired, time) - turned_at(desired, desired->changed);
}

void gbt_desired_pace(gbt_desired *desired, double time, double distance)
{
    const double asked = desired->rate * fmax(distance, NEAREST);
    desired->turned += desired->pace * since(desired, time);
    desired->changed = time;
    desired->pace = asked > 0 ? fmin(1, desired->speed / asked) : 1;
}

/* Components of a direction in the plane of the circle. */
static void plane_of(const gbt_desired *desired, const gbt_real *direction, double plane[2])
{
#if GBT_DIMENSION == 2
    (void)desired;
    for (int k = 0; k < 2; k++) plane[k] = (double)direction[k];
#else
    gbt_real basis[GBT_AXES][D];
    gbt_tangent_basis(desired->axis, basis);
    for (int k = 0; k < 2; k++) plane[k] = (double)gbt_dot(basis[k], direction);
#endif
}

/* On the circle, in radians, of the point nearest to a bearing. */
static double angle_of(const gbt_desired *desired, const gbt_real *bearing)
{
    double plane[2];
    plane_of(desired, bearing, plane);
    return atan2(plane[1], plane[0]);
}

void gbt_desired_begin_at(gbt_desired *desired, double time, const gbt_real *bearing)
{
    desired->phase = angle_of(desired, bearing) - desired->rate * turned_at(desired, time);
}

void gbt_desired_reverse_from(gbt_desired *desired, double time, const gbt_real *line, const gbt_real *velocity)
{
    double along[2], across[2];
    if (!(desired->reverse > 0)) return;
    plane_of(desired, line, along);
    plane_of(desired, velocity, across);
    const int agrees = desired->rate * (along[0] * across[1] - along[1] * across[0]) >= 0;
    desired->leg_start = agrees ? time : time - desired->reverse;
    gbt_desired_begin_at(desired, time, line);
}

/* The bearing at an angle on the circle. */
static void direction_at(const gbt_desired *desired, double angle, gbt_real *bearing)
{
    const gbt_real c = (gbt_real)cos(angle), s = (gbt_real)sin(angle);
#if GBT_DIMENSION == 2
    (void)desired;
    bearing[0] = c;
    bearing[1] = s;
#else
    const gbt_real lift = (gbt_real)(sqrt(3.0) / 3.0), radius = (gbt_real)CIRCLE;
    gbt_real basis[GBT_AXES][D];
    gbt_tangent_basis(desired->axis, basis);
    for (int k = 0; k < D; k++) bearing[k] = lift * desired->axis[k] + radius * (c * basis[0][k] + s * basis[1][k]);
#endif
}

void gbt_desired_at(const gbt_desired *desired, double time, gbt_real *bearing)
{
    const int paced = desired->speed > 0;
    const double turned = paced ? desired->turned + desired->pace * since(desired, time) : turned_at(desired, time);
    direction_at(desired, desired->phase + desired->rate * turned, bearing);
}

/* The part of a piece that goes forth, less that which goes back. A reversal within a piece is at the nearer end of it:
   a plan that is told bearings at the ends alone would cut the corner. Legs shorter than a piece are averaged. */
static double forth_in(const gbt_desired *desired, double time, double period, int piece)
{
    const double begin = time + period * piece, end = time + period * (piece + 1);
    const double forth = (turned_at(desired, end) - turned_at(desired, begin)) / period;
    const int legs = desired->reverse >= period;
    return legs && fabs(forth) < 1 - WITHIN ? copysign(1.0, forth) : forth;
}

void gbt_desired_sweep(const gbt_desired *desired, double time, const gbt_real *line,
                       gbt_real target[GBT_PIECES + 1][GBT_DIMENSION], gbt_real bearings[GBT_PIECES][GBT_DIMENSION])
{
    const double period = (double)GBT_PERIOD, reach = desired->across * period;
    const double radius = fmax(CIRCLE * (double)gbt_length(line), NEAREST);
    double angle = angle_of(desired, line), plane[2];
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_real moved[D];
        for (int k = 0; k < D; k++) moved[k] = target[i + 1][k] - target[i][k];
        plane_of(desired, moved, plane);
        const double across = cos(angle) * plane[1] - sin(angle) * plane[0];
        const double left = reach * reach - ((double)gbt_dot(moved, moved) - across * across);
        const double own = sqrt(fmax(left, LEAST_ACROSS * reach * (LEAST_ACROSS * reach)));
        angle += (copysign(1.0, desired->rate) * forth_in(desired, time, period, i) * own + across) / radius;
        direction_at(desired, angle, bearings[i]);
    }
}
