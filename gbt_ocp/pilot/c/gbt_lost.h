/* Whether a track is lost: tracking/lost.py in C. */
#ifndef GBT_LOST_H
#define GBT_LOST_H

#include "gbt_real.h"

GBT_BEGIN_C

#define GBT_LOST_BINS 12 /* over which the mean is taken */

typedef struct {
    int count, next; /* squares that are kept, and where the next one goes */
    gbt_real square[GBT_LOST_BINS];
} gbt_lost;

/* Notes the squared standardised innovation of a bin, a component; whether the track is lost. A track begins with a count and
   a place of 0. */
int gbt_lost_after(gbt_lost *lost, gbt_real square);

GBT_END_C

#endif
