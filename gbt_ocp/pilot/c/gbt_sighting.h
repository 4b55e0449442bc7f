/* What a sensor measured, and the same placed in the earth frame: models/measurements.py in C. Angles are in radians,
   counter-clockwise from +x (earth frame) or from the bow, elevations upwards from the horizontal; lengths in metres,
   times in seconds and double in both precisions. */
#ifndef GBT_SIGHTING_H
#define GBT_SIGHTING_H

#include "gbt_pilot_settings.h"
#include "gbt_problem.h"

GBT_BEGIN_C

typedef enum {
    GBT_AZIMUTH = 0,
    GBT_AZIMUTH_ELEVATION = 1,
    GBT_ELEVATION = 2,
    GBT_RANGE = 3,
    GBT_SIZE = 4,    /* the angle that the target fills */
    GBT_POSITION = 5 /* of the target, in the frame */
} gbt_kind;

typedef enum {
    GBT_AS_CONFIGURED = 0, /* what is configured for the sensor; earth for one that is not */
    GBT_EARTH = 1,         /* angles and components of positions count from +x */
    GBT_BOW = 2            /* from the bow */
} gbt_frame;

/* Of a sensor on the vehicle. */
typedef struct {
    int sensor;                       /* its number, 0 .. GBT_SENSORS - 1; the configured ones come first */
    gbt_frame frame;                  /* what its measurements refer to */
    int mounted;                      /* 1: position and yaw below count; 0: those that are configured, if any */
    gbt_real position[GBT_DIMENSION]; /* from the vehicle's origin: forward, to port(, up), m */
    gbt_real yaw;                     /* from the bow to its zero direction, rad */
} gbt_sensor_pose;

/* What is configured of a sensor. */
typedef struct {
    gbt_sensor_pose pose;
    gbt_real std;         /* deviation of what does not state one; 0 if `share` counts */
    gbt_real share;       /* the same over the value */
    gbt_real heading_std; /* of the own heading, rad */
} gbt_sensor;

typedef struct {
    double time;
    gbt_kind kind;
    int stated; /* whether the deviation is stated */
    gbt_real value[GBT_DIMENSION], std[GBT_DIMENSION];
    gbt_sensor_pose sensor;
} gbt_measurement;

typedef struct {
    double time;
    gbt_kind kind;
    int sensor;
    int stated; /* whether the deviation is stated; std is 0 otherwise */
    gbt_real value[GBT_DIMENSION], std[GBT_DIMENSION];
    gbt_real position[GBT_DIMENSION]; /* of the sensor */
} gbt_sighting;

extern const gbt_sensor gbt_listed_sensors[]; /* the configured ones, GBT_LISTED; generated */
extern const char *const gbt_sensor_names[];  /* their names */

/* Numbers of a value: 1, 2 of GBT_AZIMUTH_ELEVATION, GBT_DIMENSION of GBT_POSITION. */
int gbt_components(gbt_kind kind);

/* Fills in what is configured of the sensor and the measurement does not say. */
void gbt_complete(const gbt_sensor *sensor, gbt_measurement *measurement);

/* In the earth frame, from where the vehicle was: position and yaw, and the deviation of the yaw. */
void gbt_place_sighting(const gbt_measurement *measurement, const gbt_real *pose, gbt_real heading_std,
                        gbt_sighting *sighting);

/* Whether it is a direction and nothing else. */
int gbt_is_bearing(const gbt_sighting *sighting);

GBT_END_C

#endif
