/* The origin of a pilot's coordinates in single precision, which moves along with the vehicle: 10 km from an origin a float
   knows a position to a millimetre. In double precision it stays where the coordinates of the caller begin. */
#ifndef GBT_ORIGIN_H
#define GBT_ORIGIN_H

#include "gbt_pilot.h"

GBT_BEGIN_C

/* Moves the origin of a pilot that has just begun to its first pose, GBT_POSE, if that is far from it. */
void gbt_origin_begin(gbt_pilot *pilot, const double *pose);

/* A pose in the coordinates of the pilot. */
void gbt_origin_place(const gbt_pilot *pilot, const double *pose, gbt_real *placed);

/* Moves the origin to the vehicle where the last navigations are far from it. */
void gbt_origin_follow(gbt_pilot *pilot);

/* Positions of a measurement and of a setpoint: from the coordinates of the caller to those of the pilot, and back. */
void gbt_origin_take(const gbt_pilot *pilot, gbt_real *position);
void gbt_origin_give(const gbt_pilot *pilot, gbt_real *position);

GBT_END_C

#endif
