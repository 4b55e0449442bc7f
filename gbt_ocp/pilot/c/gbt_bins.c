#include "gbt_bins.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define ENOUGH 3                       /* bearings in a bin from which their median tells the strays among them */
#define NO_DIRECTION ((gbt_real)1e-3)  /* length of a mean of bearings that are opposite */

void gbt_bins_clear(gbt_bins *bins) { bins->count = bins->samples = 0; }

int gbt_bins_full(const gbt_bins *bins, const gbt_binning *binning, double time)
{
    return bins->count > 0 && bins->bin[bins->count - 1].index == floor(time / binning->width) &&
           bins->samples >= GBT_BIN_SAMPLES;
}

int gbt_bins_can_add(const gbt_bins *bins, const gbt_binning *binning, double time)
{
    return time > bins->latest && time < HUGE_VAL && !gbt_bins_full(bins, binning, time);
}

int gbt_bins_filled_by(const gbt_bins *bins, const gbt_binning *binning, double time)
{
    return bins->count > 0 && floor(time / binning->width) != floor(bins->latest / binning->width);
}

void gbt_bins_shift(gbt_bins *bins, const gbt_real *way)
{
    for (int j = 0; j < D; j++) {
        for (int k = 0; k < bins->count; k++) bins->bin[k].own[j] -= way[j];
        for (int k = 0; k < bins->samples; k++) bins->sample[k].own[j] -= way[j];
    }
}

double gbt_bins_begin(const gbt_bins *bins, const gbt_binning *binning) { return bins->bin[0].index * binning->width; }

/* The median of some numbers, which are put in order. */
static gbt_real median(gbt_real *values, int count)
{
    for (int k = 1; k < count; k++) {
        const gbt_real one = values[k];
        int place = k;
        for (; place > 0 && values[place - 1] > one; place--) values[place] = values[place - 1];
        values[place] = one;
    }
    return (values[(count - 1) / 2] + values[count / 2]) / 2;
}

/* Which samples count: those near the median, or of few those that are not suspected by a majority. */
static void choose(const gbt_bins *bins, gbt_real stray, int *kept)
{
    const int n = bins->samples;
    gbt_real middle[GBT_AXES], away[GBT_BIN_SAMPLES], values[GBT_BIN_SAMPLES];
    int suspects = 0, some = 0;
    for (int k = 0; k < n; k++) suspects += bins->sample[k].suspect;
    if (n < ENOUGH || !isfinite(stray)) {
        for (int k = 0; k < n; k++) kept[k] = 2 * suspects > n || !bins->sample[k].suspect;
        return;
    }
    for (int a = 0; a < GBT_AXES; a++) {
        for (int k = 0; k < n; k++) values[k] = bins->sample[k].offset[a];
        middle[a] = median(values, n);
    }
    for (int k = 0; k < n; k++) {
        gbt_real square = 0;
        for (int a = 0; a < GBT_AXES; a++) {
            const gbt_real off = bins->sample[k].offset[a] - middle[a];
            square += off * off;
        }
        values[k] = away[k] = gbt_sqrt(square) * gbt_sqrt(bins->sample[k].weight);
    }
    /* no bearing lies halfway between two halves that disagree */
    const gbt_real most = gbt_fmax(stray, median(values, n));
    for (int k = 0; k < n; k++) some += kept[k] = away[k] <= most;
    for (int k = 0; some == 0 && k < n; k++) kept[k] = 1;
}

/* Squared residuals of the samples that count about a straight line in time. */
static void scatter(const gbt_bins *bins, const int *kept, gbt_bin *bin)
{
    const gbt_binned *sample = bins->sample;
    gbt_real mean[GBT_AXES] = {0}, along[GBT_AXES] = {0}, spread = 0;
    int count = 0;
    bin->squares = bin->freedom = 0;
    for (int k = 0; k < bins->samples; k++) count += kept[k];
    if (count < 3) return;
    for (int k = 0; k < bins->samples; k++)
        for (int a = 0; kept[k] && a < GBT_AXES; a++) mean[a] += sample[k].weight * sample[k].offset[a] / bin->count;
    for (int k = 0; k < bins->samples; k++) {
        if (!kept[k]) continue;
        const gbt_real t = (gbt_real)(sample[k].time - bin->time), weighed = sample[k].weight * t;
        spread += weighed * t;
        for (int a = 0; a < GBT_AXES; a++) along[a] += weighed * (sample[k].offset[a] - mean[a]);
    }
    for (int k = 0; k < bins->samples; k++)
        for (int a = 0; kept[k] && a < GBT_AXES; a++) {
            const gbt_real t = (gbt_real)(sample[k].time - bin->time);
            const gbt_real left = sample[k].offset[a] - mean[a] - (spread > 0 ? t * (along[a] / spread) : 0);
            bin->squares += sample[k].weight * left * left;
        }
    /* without a spread several sensors have measured at one time */
    bin->freedom = (gbt_real)((count - (spread > 0 ? 2 : 1)) * GBT_AXES);
}

/* Means of the newest bin, from its first sample on, so that far from the origin no digits are lost. */
static void summarise(gbt_bins *bins, gbt_real stray)
{
    gbt_bin *bin = &bins->bin[bins->count - 1];
    const gbt_binned *first = &bins->sample[0];
    gbt_real own[D] = {0}, bearing[D] = {0};
    int kept[GBT_BIN_SAMPLES];
    double time = 0;
    choose(bins, stray, kept);
    bin->count = 0;
    for (int k = 0; k < bins->samples; k++) {
        const gbt_binned *one = &bins->sample[k];
        if (!kept[k]) continue;
        bin->count += one->weight;
        time += (double)one->weight * (one->time - first->time);
        for (int j = 0; j < D; j++) {
            own[j] += one->weight * (one->own[j] - first->own[j]);
            bearing[j] += one->weight * one->bearing[j];
        }
    }
    bin->time = first->time + time / (double)bin->count;
    for (int j = 0; j < D; j++) {
        bin->own[j] = first->own[j] + own[j] / bin->count;
        bin->bearing[j] = bearing[j] / bin->count;
    }
    /* opposite bearings in one bin have no mean direction: the vehicle ran over the target; the first one stands */
    if (!(gbt_length(bin->bearing) > NO_DIRECTION))
        for (int j = 0; j < D; j++) bin->bearing[j] = first->bearing[j];
    const gbt_real size = gbt_length(bin->bearing);
    for (int j = 0; j < D; j++) bin->bearing[j] /= size;
    scatter(bins, kept, bin);
}

void gbt_bins_forget(gbt_bins *bins, const gbt_binning *binning, double time)
{
    int old = 0;
    while (old < bins->count - 1 && (bins->bin[old].index + 1) * binning->width <= time) old++;
    for (int k = old; old > 0 && k < bins->count; k++) bins->bin[k - old] = bins->bin[k];
    bins->count -= old;
}

void gbt_bins_add(gbt_bins *bins, const gbt_binning *binning, double time, const gbt_real *bearing, const gbt_real *own,
                  const gbt_real *expected, int suspect, gbt_real weight)
{
    const double index = floor(time / binning->width);
    gbt_real basis[GBT_AXES][D];
    if (bins->count == 0 || bins->bin[bins->count - 1].index != index) {
        for (int k = 1; bins->count == GBT_BINS && k < GBT_BINS; k++) bins->bin[k - 1] = bins->bin[k];
        if (bins->count == GBT_BINS) bins->count--;
        bins->bin[bins->count++].index = index;
        bins->samples = 0;
    }
    gbt_binned *one = &bins->sample[bins->samples++];
    const gbt_real *ahead = expected ? expected : bins->samples > 1 ? bins->sample[0].bearing : bearing;
    one->time = time;
    one->suspect = suspect;
    one->weight = weight;
    for (int j = 0; j < D; j++) {
        one->bearing[j] = bearing[j];
        one->own[j] = own[j];
    }
    gbt_tangent_basis(ahead, basis);
    gbt_log_map(ahead, bearing, basis, one->offset);
    bins->latest = time;
    summarise(bins, binning->stray);
    gbt_bins_forget(bins, binning, time - binning->window);
}
