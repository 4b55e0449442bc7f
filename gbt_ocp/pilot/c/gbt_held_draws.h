/* Turn rates that are drawn again, and manners in which the speed changes from then on: tracking/held/draws.py in C. */
#ifndef GBT_HELD_DRAWS_H
#define GBT_HELD_DRAWS_H

#include "gbt_held_bank.h"

GBT_BEGIN_C

#define GBT_FARTHEST_CELL 10                          /* of log range from that of the likeliest, within which, and courses, */
#define GBT_RANGE_CELLS (2 * GBT_FARTHEST_CELL + 1)   /* components are taken together when the turn rate is drawn again */
#define GBT_COURSE_CELLS 8
#define GBT_ALL_CELLS (GBT_BRANCHES * GBT_RANGE_CELLS * GBT_COURSE_CELLS)
#define GBT_CELLS                                                                                                            \
    (GBT_COMPONENTS * GBT_SPEED_STDS < GBT_ALL_CELLS ? GBT_COMPONENTS * GBT_SPEED_STDS : GBT_ALL_CELLS) /* with components */

/* What drawing again works on. */
typedef struct {
    short number[GBT_ALL_CELLS];    /* of a cell among those that have components, counted from 1; 0 without any */
    short place[GBT_COMPONENTS];    /* of each component, by range and course */
    short best[GBT_CELLS];          /* the likeliest component of each cell */
    gbt_real total[GBT_CELLS];      /* and the weight of all of its components */
} gbt_cells;

/* Those in one manner of changing the speed, in each other one; returns how many. */
int gbt_bank_other_manners(const gbt_held_prior *prior, const gbt_component *given, int count, gbt_component *others);

/* One component for each cell that has some, with their moments and its turn rate, and vertical speed, drawn again, whose
   weight is a share of theirs; in a few of them the speed changes in another manner from now on. Returns how many. */
int gbt_bank_draw_again(const gbt_held_prior *prior, const gbt_component *given, int count, gbt_real share,
                        gbt_cells *cells, gbt_component *again);

GBT_END_C

#endif
