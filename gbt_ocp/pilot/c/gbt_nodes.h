/* Moments at evenly spaced times, and in between and beyond: NodeMoments of tracking/shape/moments.py in C. */
#ifndef GBT_NODES_H
#define GBT_NODES_H

#include "gbt_problem.h"

GBT_BEGIN_C

/* Between which of so many nodes a time lies, so many steps after the first one: the earlier, and how far beyond it. */
int gbt_node_before(double time, double step, int nodes, gbt_real *share);

/* From the moments at the nodes about a time to those at it, in their place: GBT_DIMENSION, and GBT_DIMENSION^2. Linear in
   between. After the last of the nodes the mean goes straight on, and the covariance grows with the cube of the time. */
void gbt_between_nodes(double time, double step, int nodes, gbt_real *mean, gbt_real *covariance, const gbt_real *next,
                       const gbt_real *spread);

GBT_END_C

#endif
