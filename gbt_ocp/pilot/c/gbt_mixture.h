/* Trackers with different ideas of motion, weighed by how well each predicted the bearings of late: tracking/mixture.py in C,
   which says why. Its members are held turn rates and interacting models. */
#ifndef GBT_MIXTURE_H
#define GBT_MIXTURE_H

#include "gbt_binned.h"
#include "gbt_held_turn.h"

GBT_BEGIN_C

typedef enum { GBT_MEMBER_HELD_TURN = 0, GBT_MEMBER_IMM_EKF = 1 } gbt_member;

typedef struct {
    gbt_held_turn_settings held;
    gbt_binned_settings models;
    gbt_bearing_noise noise;
    gbt_binning binning;
    double forgetting;         /* time in which evidence fades, s; may be infinite */
    int member[GBT_MEMBERS];   /* which is which; the first stands for all until each of them has begun */
} gbt_mixture_settings;

typedef struct {
    double begins;                 /* when the newest bin begins, s; minus infinity before the first */
    int seen, predicted;           /* whether there was a bearing, and whether anything was said of the newest bin */
    int told;                      /* whether the range is told */
    gbt_real weight[GBT_MEMBERS];  /* of the members in a forecast; 0 of those that are left out */
    gbt_real evidence[GBT_MEMBERS]; /* logarithms, for the full bins until now, faded */
    gbt_real own[GBT_DIMENSION];   /* own position at the latest bearing, or where the track began */
    gbt_real mean[GBT_MEMBERS][2][GBT_DIMENSION]; /* what each said of the two ends of the newest bin before it began */
    gbt_real covariance[GBT_MEMBERS][2][GBT_DIMENSION][GBT_DIMENSION];
    gbt_gaps gaps;
    double latest;                 /* time of the latest measurement, s */
    gbt_bins bins;
    gbt_binned_filter models;
    gbt_held_turn held;
} gbt_mixture;

typedef gbt_held_turn_work gbt_mixture_work;

/* Sizes of both, for callers that do not see the structs. */
size_t gbt_mixture_bytes(void);
size_t gbt_mixture_work_bytes(void);

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_mixture_begin(gbt_mixture *mixture, const gbt_mixture_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_mixture_shift(gbt_mixture *mixture, const gbt_real *way);

/* Takes a bearing, a unit vector, from a position, both finite; 0 where its time is not after that of the last one, or where
   there is no room for it in its bin. */
int gbt_mixture_update(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work, double time,
                       const gbt_real *bearing, const gbt_real *own);

/* Takes a measurement of any kind; 0 where gbt_can_take refuses it, or where there is no room. */
int gbt_mixture_take(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work,
                     const gbt_sighting *sighting);

/* Gets ready to be asked for forecasts as far ahead as a time, from now on. */
void gbt_mixture_ask(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work, double time);

/* Where the target is at a time, and the covariance of that. */
void gbt_mixture_predict(const gbt_mixture *mixture, const gbt_mixture_settings *settings, double time, gbt_real *mean,
                         gbt_real *covariance);

/* How often tracks of members were lost and begun again. */
int gbt_mixture_restarts(const gbt_mixture *mixture);

/* What one member says of a time. */
void gbt_mixture_believe(const gbt_mixture *mixture, const gbt_mixture_settings *settings, int member, double time,
                         gbt_real *mean, gbt_real *covariance);

/* The same at so many times, however far ahead. */
void gbt_mixture_forecast(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work,
                         const double *time, int count, gbt_real *mean, gbt_real *covariance);

GBT_END_C

#endif
