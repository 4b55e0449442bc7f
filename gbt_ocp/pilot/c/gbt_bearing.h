/* Bearings: unit vectors to a target, and their tangent planes. The same as models/bearings.py. */
#ifndef GBT_BEARING_H
#define GBT_BEARING_H

#include "gbt_problem.h"

GBT_BEGIN_C

#define GBT_AXES (GBT_DIMENSION - 1) /* axes of a tangent plane */

gbt_real gbt_dot(const gbt_real *a, const gbt_real *b);    /* of two vectors, GBT_DIMENSION each */
gbt_real gbt_length(const gbt_real *a);

/* The unit vector from own to target; 0, and no vector, where they coincide. */
int gbt_unit_bearing(const gbt_real *target, const gbt_real *own, gbt_real *bearing);

/* The unit vector of an azimuth, or of an azimuth and an elevation. */
void gbt_unit_of_angles(const gbt_real *angles, gbt_real *bearing);

/* Azimuth, and elevation in space, of a bearing. */
void gbt_angles_of(const gbt_real *bearing, gbt_real *angles);

/* Axes of the tangent plane at a bearing, one a row. */
void gbt_tangent_basis(const gbt_real *bearing, gbt_real basis[GBT_AXES][GBT_DIMENSION]);

/* A bearing turned by an angle in its tangent plane. */
void gbt_rotate_bearing(const gbt_real *bearing, const gbt_real *angle, gbt_real *turned);

/* The angle from an expected to a measured bearing along these axes: the inverse of gbt_rotate_bearing. */
void gbt_log_map(const gbt_real *expected, const gbt_real *measured, gbt_real basis[GBT_AXES][GBT_DIMENSION],
                 gbt_real *angle);

/* Covariance along these axes, GBT_AXES x GBT_AXES, of a covariance of positions. */
void gbt_across(gbt_real basis[GBT_AXES][GBT_DIMENSION], const gbt_real *covariance, gbt_real *across);

GBT_END_C

#endif
