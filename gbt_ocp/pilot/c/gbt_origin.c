#include "gbt_origin.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define FAR ((gbt_real)512) /* from the origin, m: a float knows a position there to 0.03 mm */

#if defined(GBT_SINGLE) && GBT_RELATIVE
/* Whether a position is far from the origin, and the way there in the horizontal plane: depths are small numbers. */
static int is_far(const gbt_real *position, gbt_real *way)
{
    for (int k = 0; k < D; k++) way[k] = k < 2 ? rintf(position[k]) : 0;
    return gbt_fabs(way[0]) > FAR || gbt_fabs(way[1]) > FAR;
}

/* Takes a way off all positions. */
static void shift(gbt_pilot *pilot, const gbt_real *way)
{
    gbt_intake *intake = &pilot->intake;
    gbt_guidance *guidance = &pilot->guidance;
    gbt_tracker_shift(&pilot->tracker, way);
    for (int k = 0; k < intake->states; k++) gbt_tracker_shift(&intake->state[k].tracker, way);
    for (int j = 0; j < D; j++) {
        pilot->origin[j] += (double)way[j];
        guidance->room.planner.origin[j] = pilot->origin[j];
#if GBT_SHOOTING
        guidance->began[j] -= way[j];
        for (int k = 0; k <= GBT_GRID; k++) guidance->regulator.state[k][j] -= way[j];
#else
        guidance->follower.start[0][j] -= way[j];
#endif
        pilot->own.doubtful.pose[j] -= way[j];
        for (int k = 0; k < pilot->own.count; k++) pilot->own.state[k].pose[j] -= way[j];
        for (int k = 0; k < intake->taken + intake->arrived; k++) {
            intake->sightings[k].position[j] -= way[j];
            if (intake->sightings[k].kind == GBT_POSITION) intake->sightings[k].value[j] -= way[j];
        }
        for (int k = 0; k <= GBT_AHEAD; k++) {
            pilot->forecast.mean[k][j] -= way[j];
            pilot->usable.mean[k][j] -= way[j];
        }
    }
}

void gbt_origin_follow(gbt_pilot *pilot)
{
    const gbt_own_track *own = &pilot->own;
    gbt_real way[D];
    /* two in a row, so that a single wrong navigation moves nothing */
    if (own->count < 2 || !is_far(own->state[own->count - 2].pose, way)) return;
    if (is_far(own->state[own->count - 1].pose, way)) shift(pilot, way);
}

void gbt_origin_begin(gbt_pilot *pilot, const double *pose)
{
    gbt_real position[D], way[D];
    for (int k = 0; k < D; k++) position[k] = (gbt_real)pose[k];
    if (is_far(position, way)) shift(pilot, way);
}
#else
void gbt_origin_begin(gbt_pilot *pilot, const double *pose)
{
    (void)pilot;
    (void)pose;
}

void gbt_origin_follow(gbt_pilot *pilot) { (void)pilot; }
#endif

void gbt_origin_place(const gbt_pilot *pilot, const double *pose, gbt_real *placed)
{
    for (int k = 0; k < GBT_POSE; k++) placed[k] = (gbt_real)(k < D ? pose[k] - pilot->origin[k] : pose[k]);
}

void gbt_origin_take(const gbt_pilot *pilot, gbt_real *position)
{
    for (int k = 0; k < D; k++) position[k] = (gbt_real)((double)position[k] - pilot->origin[k]);
}

void gbt_origin_give(const gbt_pilot *pilot, gbt_real *position)
{
    for (int k = 0; k < D; k++) position[k] = (gbt_real)((double)position[k] + pilot->origin[k]);
}
