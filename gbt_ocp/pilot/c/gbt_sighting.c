#include "gbt_sighting.h"

#include "gbt_math.h"

#define D GBT_DIMENSION

int gbt_components(gbt_kind kind) { return kind == GBT_POSITION ? D : kind == GBT_AZIMUTH_ELEVATION ? 2 : 1; }

void gbt_complete(const gbt_sensor *sensor, gbt_measurement *measurement)
{
    gbt_sensor_pose *pose = &measurement->sensor;
    for (int k = 0; !measurement->stated && k < gbt_components(measurement->kind); k++)
        measurement->std[k] = sensor->share > 0 ? sensor->share * gbt_fabs(measurement->value[k]) : sensor->std;
    measurement->stated = 1;
    if (pose->frame == GBT_AS_CONFIGURED) pose->frame = sensor->pose.frame;
    if (!pose->mounted) {
        for (int k = 0; k < D; k++) pose->position[k] = sensor->pose.position[k];
        pose->yaw = sensor->pose.yaw;
        pose->mounted = 1;
    }
}

/* A horizontal vector turned by an angle. */
static void turn_level(gbt_real *level, gbt_real angle)
{
    const gbt_real c = gbt_cos(angle), s = gbt_sin(angle), x = level[0], y = level[1];
    level[0] = c * x - s * y;
    level[1] = s * x + c * y;
}

void gbt_place_sighting(const gbt_measurement *measurement, const gbt_real *pose, gbt_real heading_std,
                        gbt_sighting *sighting)
{
    const gbt_sensor_pose *sensor = &measurement->sensor;
    const gbt_real yaw = pose[D], turn = yaw + (sensor->mounted ? sensor->yaw : 0);
    gbt_real arm[D];
    sighting->time = measurement->time;
    sighting->kind = measurement->kind;
    sighting->sensor = sensor->sensor;
    sighting->stated = measurement->stated;
    for (int k = 0; k < D; k++) {
        arm[k] = sensor->mounted ? sensor->position[k] : 0;
        sighting->value[k] = measurement->value[k];
        sighting->std[k] = measurement->stated ? measurement->std[k] : 0;
    }
    turn_level(arm, yaw);
    for (int k = 0; k < D; k++) sighting->position[k] = pose[k] + arm[k];
    if (sensor->frame != GBT_BOW) return;
    if (measurement->kind == GBT_POSITION) {
        turn_level(sighting->value, turn);
        for (int k = 0; k < D; k++) sighting->value[k] += sighting->position[k];
    } else if (measurement->kind == GBT_AZIMUTH || measurement->kind == GBT_AZIMUTH_ELEVATION) {
        sighting->value[0] += turn;
        sighting->std[0] = measurement->stated ? gbt_hypot(sighting->std[0], heading_std) : 0;
    }
}

int gbt_is_bearing(const gbt_sighting *sighting)
{
    return sighting->kind == (D == 2 ? GBT_AZIMUTH : GBT_AZIMUTH_ELEVATION);
}
