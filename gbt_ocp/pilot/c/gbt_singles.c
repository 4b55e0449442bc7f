#include "gbt_singles.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define ALIKE ((gbt_real)1.1)        /* ratio of two deviations below which they count as one */
#define LEAST_LEVEL ((gbt_real)1e-3) /* share of the line of sight in the horizontal below which azimuths say nothing */

/* A position: its direction and its range. */
static void parts_of_position(const gbt_sighting *sighting, gbt_sighting_parts *parts)
{
    gbt_real line[D], along = 0, total = 0;
    gbt_unit_bearing(sighting->value, sighting->position, parts->unit);
    for (int k = 0; k < D; k++) {
        const gbt_real square = sighting->std[k] * sighting->std[k];
        line[k] = sighting->value[k] - sighting->position[k];
        along += parts->unit[k] * parts->unit[k] * square;
        total += square;
    }
    const gbt_real far = gbt_length(line);
    parts->bearing = parts->single = 1;
    parts->std = gbt_sqrt((total - along) / (D - 1)) / far;
    parts->rest.kind = GBT_RANGE;
    parts->rest.value[0] = far;
    parts->rest.std[0] = gbt_sqrt(along);
}

#if GBT_DIMENSION == 3
/* Azimuth and elevation: a bearing with the larger deviation of the two, and the rest of what the sharper angle says. */
static void parts_of_angles(const gbt_sighting *sighting, gbt_sighting_parts *parts)
{
    const gbt_real level = gbt_fmax(gbt_cos(sighting->value[1]), LEAST_LEVEL);
    const gbt_real sideways = sighting->std[0] * level, upwards = sighting->std[1];
    const gbt_real blunt = gbt_fmax(sideways, upwards), sharp = gbt_fmin(sideways, upwards);
    if (blunt <= ALIKE * sharp) {
        parts->std = gbt_sqrt((blunt * blunt + sharp * sharp) / 2);
        return;
    }
    const int which = sideways < upwards ? 0 : 1;
    parts->std = blunt;
    parts->single = 1;
    parts->rest.kind = which == 0 ? GBT_AZIMUTH : GBT_ELEVATION;
    parts->rest.value[0] = sighting->value[which];
    parts->rest.std[0] = 1 / gbt_sqrt(1 / (sharp * sharp) - 1 / (blunt * blunt)) / (which == 0 ? level : 1);
}
#endif

void gbt_parts_of(const gbt_sighting *sighting, gbt_real bearing_std, gbt_sighting_parts *parts)
{
    parts->bearing = parts->single = 0;
    parts->std = 0;
    parts->rest = *sighting;
    parts->rest.stated = 1;
    if (sighting->kind == GBT_POSITION) {
        parts_of_position(sighting, parts);
    } else if (!gbt_is_bearing(sighting)) {
        parts->single = 1;
        if (!sighting->stated) parts->rest.std[0] = bearing_std;
    } else {
        parts->bearing = 1;
        gbt_unit_of_angles(sighting->value, parts->unit);
        if (!sighting->stated) return;
#if GBT_DIMENSION == 2
        parts->std = sighting->std[0];
#else
        parts_of_angles(sighting, parts);
#endif
    }
}

double gbt_singles_latest(const gbt_singles *singles)
{
    double latest = -HUGE_VAL;
    for (int k = 0; k < singles->count; k++) latest = fmax(latest, singles->single[k].sighting.time);
    return latest;
}

/* The number of the bin of a time, as Python's // rounds it. */
static double bin_of(double time, double width)
{
    double rest = fmod(time, width);
    if (rest < 0) rest += width;
    return rint((time - rest) / width);
}

/* Into the mean of so many measurements. All count alike: weights by deviations that go with the values would favour the
   small ones. */
static void average(gbt_sighting *mean, int count, const gbt_sighting *single)
{
    const gbt_real share = 1 / (gbt_real)(count + 1);
    gbt_real off = single->value[0] - mean->value[0];
    if (single->kind == GBT_AZIMUTH) off = gbt_atan2(gbt_sin(off), gbt_cos(off));
    mean->time += (single->time - mean->time) / (count + 1);
    mean->value[0] += share * off;
    mean->std[0] = share * gbt_hypot((gbt_real)count * mean->std[0], single->std[0]);
    for (int k = 0; k < D; k++) mean->position[k] += share * (single->position[k] - mean->position[k]);
}

void gbt_singles_add(gbt_singles *singles, double width, const gbt_sighting *single)
{
    const double bin = bin_of(single->time, width);
    for (int k = singles->count - 1; k >= 0 && bin_of(singles->single[k].sighting.time, width) == bin; k--) {
        gbt_sighting *one = &singles->single[k].sighting;
        if (one->kind != single->kind || one->sensor != single->sensor) continue;
        average(one, singles->single[k].averaged, single);
        singles->single[k].averaged++;
        return;
    }
    for (int k = 1; singles->count == GBT_OTHERS && k < GBT_OTHERS; k++) singles->single[k - 1] = singles->single[k];
    if (singles->count == GBT_OTHERS) singles->count--;
    singles->single[singles->count].averaged = 1;
    singles->single[singles->count++].sighting = *single;
}

void gbt_singles_forget(gbt_singles *singles, double time)
{
    int rest = 0;
    for (int k = 0; k < singles->count; k++)
        if (singles->single[k].sighting.time >= time) singles->single[rest++] = singles->single[k];
    singles->count = rest;
}
