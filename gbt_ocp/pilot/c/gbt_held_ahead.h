/* Moments of the position ahead, of Gaussians that hold their turn rate and draw it again now and then:
   tracking/held/ahead.py in C, which says why. Nodes are GBT_AHEAD_STEP apart, the first of them now. */
#ifndef GBT_HELD_AHEAD_H
#define GBT_HELD_AHEAD_H

#include "gbt_held_bank.h"

GBT_BEGIN_C

#define GBT_AHEAD_STEP 2 /* seconds between the nodes of a forecast; between them it is linear */

/* What does not differ from component to component, a number a node. */
typedef struct {
    gbt_real left[GBT_HELD_NODES], kept[GBT_HELD_NODES]; /* of a turn rate, and of a change of log speed, of now */
    gbt_real turned[GBT_HELD_NODES];                     /* course of a turn rate of now, */
    gbt_real drawn[GBT_HELD_NODES];                      /* and of one that is drawn so many nodes before */
} gbt_fading;

/* A walk along the nodes ahead of a component: position relative to the own one now, by trapezoids. */
typedef struct {
    gbt_real start[GBT_DIMENSION], polar[GBT_DIMENSION][GBT_DIMENSION], rate[2]; /* its velocity at the last node */
    gbt_real way[2];                                       /* from now to the node */
    gbt_real sideways[2 + GBT_HELD_NODES][2];              /* slopes of that by course, turn rate, and its draws, */
    gbt_real onwards[2 + GBT_HELD_NODES][2];               /* and by level, change, and its draws */
    gbt_real turn_draw[GBT_HELD_NODES], speed_draw[GBT_HELD_NODES], climb_draw[GBT_HELD_NODES]; /* their variances */
} gbt_ahead;

/* For so many nodes. */
void gbt_fading_begin(const gbt_held_prior *prior, int nodes, gbt_fading *fading);

/* Moments at the first of so many nodes, and at each that follows. */
void gbt_ahead_begin(gbt_ahead *ahead, const gbt_held_prior *prior, const gbt_fading *fading, int nodes,
                     const gbt_component *one, gbt_real *mean, gbt_real *covariance);
void gbt_ahead_next(gbt_ahead *ahead, const gbt_fading *fading, const gbt_component *one, int node, gbt_real *mean,
                    gbt_real *covariance);

GBT_END_C

#endif
