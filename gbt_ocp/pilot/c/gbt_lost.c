#include "gbt_lost.h"

#define LOST_SQUARE ((gbt_real)6) /* mean squared innovation of the recent bins above which a track counts as lost */

int gbt_lost_after(gbt_lost *lost, gbt_real square)
{
    gbt_real sum = 0;
    lost->square[lost->next] = square;
    lost->next = (lost->next + 1) % GBT_LOST_BINS;
    if (lost->count < GBT_LOST_BINS) lost->count++;
    for (int k = 0; k < lost->count; k++) sum += lost->square[k];
    return lost->count == GBT_LOST_BINS && sum / GBT_LOST_BINS > LOST_SQUARE;
}
