#include "gbt_held_draws.h"

#include "gbt_math.h"

#define N GBT_BANK_STATE
#define AT GBT_HELD_AT
#define RANGE_CELL ((gbt_real)0.4)
#define NEW_MANNER ((gbt_real)0.02) /* probability that the speed changes in another manner where the turn rate is drawn again */
#define FORGOTTEN ((gbt_real)1e-6) /* part of the weight of the likeliest with which nothing begins in another manner */
#define LEAST ((gbt_real)1e-30) /* of a total that something is over, or a square root is taken of */

static int bounded(gbt_real place, int low, int high)
{
    return place > (gbt_real)high ? high : place > (gbt_real)low ? (int)place : low;
}

static gbt_real range_cell(const gbt_component *one) { return gbt_floor(one->mean[GBT_AT_LOG_RANGE] / RANGE_CELL); }

/* Of the log range, beside that of the likeliest, and course of a component, without its branch. */
static int place_of(const gbt_component *one, const gbt_component *likeliest)
{
    const int range = bounded(range_cell(one) - range_cell(likeliest), -GBT_FARTHEST_CELL, GBT_FARTHEST_CELL) + GBT_FARTHEST_CELL;
    const gbt_real turned = gbt_wrapped(one->mean[GBT_AT_COURSE]) / (GBT_TURN / GBT_COURSE_CELLS);
    const int course = bounded(gbt_floor(turned), -GBT_COURSE_CELLS / 2, GBT_COURSE_CELLS / 2 - 1) + GBT_COURSE_CELLS / 2;
    return range * GBT_COURSE_CELLS + course;
}

/* An angle of a component near that of the likeliest of its cell. */
static gbt_real near_best(const gbt_component *one, const gbt_component *best, int at)
{
    const gbt_real near = best->mean[at];
    return at == GBT_AT_AZIMUTH || at == GBT_AT_COURSE ? near + gbt_wrapped(one->mean[at] - near) : one->mean[at];
}

/* The turn rate, or the vertical speed, with a mean of zero and independent of all else. */
static void draw(gbt_component *one, int at, gbt_real std)
{
    one->mean[at] = 0;
    for (int j = 0; j < N; j++) one->covariance[AT(at, j)] = 0;
    one->covariance[AT(at, at)] = std * std;
}

/* The branch with the manner of changing the speed that comes so many after that of a branch. */
static int in_manner(int branch, int further)
{
    const int before = branch % GBT_SPEED_STDS;
    return branch - before + (before + further) % GBT_SPEED_STDS;
}

/* Number of the cell of a component that lets go, 0 while nothing is in it. */
static short *cell_of(gbt_cells *cells, const gbt_component *given, int k, int further)
{
    return &cells->number[in_manner(given[k].branch, further) * GBT_RANGE_CELLS * GBT_COURSE_CELLS + cells->place[k]];
}

/* Another manner begins at the speed that there is: its level is that, and the change from it is drawn. */
static void change_manner(const gbt_held_prior *prior, int further, gbt_component *one)
{
    gbt_real *const covariance = one->covariance;
    one->branch = in_manner(one->branch, further);
    one->mean[GBT_AT_LEVEL] += one->mean[GBT_AT_CHANGE];
    covariance[AT(GBT_AT_LEVEL, GBT_AT_LEVEL)] +=
        2 * covariance[AT(GBT_AT_LEVEL, GBT_AT_CHANGE)] + covariance[AT(GBT_AT_CHANGE, GBT_AT_CHANGE)];
    for (int j = 0; j < N; j++)
        if (j != GBT_AT_LEVEL) covariance[AT(GBT_AT_LEVEL, j)] += covariance[AT(GBT_AT_CHANGE, j)];
    draw(one, GBT_AT_CHANGE, gbt_speed_std(prior, one->branch));
}

/* The part of its weight, over that of the likeliest, with which a component is in a manner where others have a probability
   together; 0 where that is forgotten. */
static gbt_real manner_weight(const gbt_component *one, gbt_real top, int further, gbt_real probability)
{
    const gbt_real weight = gbt_exp(one->log_weight - top);
    if (GBT_SPEED_STDS == 1) return weight;
    if (further == 0) return (1 - probability) * weight;
    const gbt_real other = probability / (gbt_real)(GBT_SPEED_STDS - 1) * weight;
    return other > FORGOTTEN ? other : 0;
}

static int likeliest_of(const gbt_component *given, int count)
{
    int likeliest = 0;
    for (int k = 1; k < count; k++)
        if (given[k].log_weight > given[likeliest].log_weight) likeliest = k;
    return likeliest;
}

int gbt_bank_other_manners(const gbt_held_prior *prior, const gbt_component *given, int count, gbt_component *others)
{
    const gbt_real top = given[likeliest_of(given, count)].log_weight, probability = 1 - 1 / (gbt_real)GBT_SPEED_STDS;
    int some = 0;
    for (int further = 1; further < GBT_SPEED_STDS; further++)
        for (int k = 0; k < count; k++) {
            if (!(manner_weight(&given[k], top, further, probability) > 0)) continue;
            others[some] = given[k];
            change_manner(prior, further, &others[some++]);
        }
    return some;
}

int gbt_bank_draw_again(const gbt_held_prior *prior, const gbt_component *given, int count, gbt_real share,
                        gbt_cells *cells, gbt_component *again)
{
    int some = 0;
    const int likeliest = likeliest_of(given, count);
    for (int k = 0; k < GBT_ALL_CELLS; k++) cells->number[k] = 0;
    for (int k = 0; k < count; k++) cells->place[k] = (short)place_of(&given[k], &given[likeliest]);
    const gbt_real top = given[likeliest].log_weight;
    for (int further = 0; further < GBT_SPEED_STDS; further++)
        for (int k = 0; k < count; k++) {
            const gbt_real weight = manner_weight(&given[k], top, further, NEW_MANNER);
            short *number = cell_of(cells, given, k, further);
            if (!(weight > 0)) continue;
            if (*number == 0) {
                again[some] = (gbt_component){0};
                again[some].branch = in_manner(given[k].branch, further);
                again[some].log_weight = weight; /* of the likeliest, until the sum is known */
                cells->best[some] = (short)k;
                cells->total[some] = 0;
                *number = (short)++some;
            }
            gbt_component *cell = &again[*number - 1];
            cells->total[*number - 1] += weight;
            if (weight > cell->log_weight) {
                cells->best[*number - 1] = (short)k;
                cell->log_weight = weight;
            }
        }
    for (int covariances = 0; covariances < 2; covariances++) /* they are about the means, which come first */
        for (int further = 0; further < GBT_SPEED_STDS; further++)
            for (int k = 0; k < count; k++) {
                const gbt_real weight = manner_weight(&given[k], top, further, NEW_MANNER);
                if (!(weight > 0)) continue;
                const int cell = *cell_of(cells, given, k, further) - 1;
                const gbt_component *best = &given[cells->best[cell]];
                const gbt_real part = weight / gbt_fmax(cells->total[cell], LEAST);
                gbt_component one = given[k];
                gbt_real *mean = again[cell].mean, apart[N];
                if (further > 0) change_manner(prior, further, &one);
                if (!covariances) {
                    for (int i = 0; i < N; i++) mean[i] += part * near_best(&one, best, i);
                    continue;
                }
                for (int i = 0; i < N; i++) apart[i] = near_best(&one, best, i) - mean[i];
                for (int i = 0; i < N; i++)
                    for (int j = 0; j <= i; j++)
                        again[cell].covariance[AT(i, j)] += part * (one.covariance[AT(i, j)] + apart[i] * apart[j]);
            }
    for (int cell = 0; cell < some; cell++) {
        again[cell].log_weight = gbt_log(cells->total[cell]) + top + gbt_log(share);
        draw(&again[cell], GBT_AT_TURN, gbt_turn_std(prior, again[cell].branch));
#if GBT_DIMENSION == 3
        draw(&again[cell], GBT_AT_CLIMB, prior->climb_std);
#endif
    }
    return some;
}
