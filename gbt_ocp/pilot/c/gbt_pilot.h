/* The pilot: navigations and measurements in, a command out, in any order and at any rate.

       static gbt_pilot pilot;            tens of kilobytes: too large for many a stack
       static gbt_command command;
       gbt_pilot_init(&pilot);
       whenever the vehicle knows where it is:
           gbt_pilot_navigate(&pilot, time, pose, velocity, 0);
       whenever a sensor has measured:
           gbt_pilot_measure(&pilot, GBT_AZIMUTH, &azimuth, 0, 0, time);
       every gbt_pilot_numbers.period seconds, or more often:
           gbt_pilot_command(&pilot, time, &command);
           apply command.thrust, or hand command.setpoint to an autopilot, until the next command

   The same calls give the same answers as gbt_ocp.Pilot in Python. All times are seconds of one clock that does not step
   back. A measurement is given to the tracker at the next command, in the order of the times at which things were
   measured, at the own pose of that time. Nothing is allocated, and every loop is bounded by the sizes in
   gbt_pilot_settings.h and by the iterations of the planner. */
#include "gbt_identity.h"

#ifndef GBT_PILOT_H
#define GBT_PILOT_H

#include "gbt_current.h"
#include "gbt_guidance.h"
#include "gbt_intake.h"
#include "gbt_own_track.h"
#include "gbt_watch.h"

GBT_BEGIN_C

/* What is not as it should be; command.notes is the sum of those that hold. */
enum {
    GBT_NOTE_NO_NAVIGATION = 1,    /* nothing was navigated yet; the thrust is zero */
    GBT_NOTE_NAVIGATION_OLD = 2,   /* the last navigation is older than gbt_pilot_numbers.navigation_gap */
    GBT_NOTE_STEPPED_BACK = 4,     /* asked for at a time before the last command, which is given again */
    GBT_NOTE_NO_BEARING = 8,       /* the tracker has taken no measurement yet */
    GBT_NOTE_TRACK_LOST = 16,      /* bearings and forecast disagree, or the direction to the target is not known */
    GBT_NOTE_FORECAST_HELD = 32,   /* the forecast was not finite; the last finite one is used */
    GBT_NOTE_FALLBACK = 64,        /* the first solve of the last plan failed; `origin` says what is followed instead */
    GBT_NOTE_GIVEN_UP = 128        /* the plan does not keep all limits; pilot.guidance.plan.given_up says which */
};

typedef enum {
    GBT_COMMANDED = 0,
    GBT_COMMAND_AGAIN = 1,         /* the last command, asked for at its time or before */
    GBT_COMMAND_BLIND = 2,         /* nothing was navigated yet; the thrust is zero */
    GBT_COMMAND_NO_PLAN = 3,       /* numbers so large that no plan is finite; the thrust is zero, nothing was done */
    GBT_COMMAND_NOT_FINITE = 4     /* the time is not finite; the thrust is zero, nothing was done */
} gbt_command_status;

typedef struct {
    gbt_command_status status;
    double time;
    gbt_real thrust[GBT_INPUTS]; /* to hold until the next command, within the limits, body frame, N and N m */
    int range_known;             /* whether the deviation of the range is below a quarter of the range */
    int notes;                   /* 0 if all is well */
    int following;               /* whether a plan is followed; otherwise the vehicle crosses the line of sight */
    gbt_setpoint setpoint;       /* where to be gbt_pilot_numbers.lead later; its status says whether there is one */
    int planned;                 /* whether a plan was ever made; status and origin of the last one: */
    gbt_status planner;
    gbt_origin origin;
    double bearing_age;          /* seconds since the last measurement that the tracker took; infinite before it */
    double navigation_age;       /* seconds since the last navigation; infinite before it */
    int track_lost, waiting, new_tracks; /* as the note; measurements that wait for a navigation; tracks after a gap */
    unsigned received[GBT_ANSWERS];      /* how often each answer other than GBT_TAKEN was given */
} gbt_command;

typedef struct {
    /* where the coordinates of all positions here begin, m, in those of the caller: 0 in double precision; in single
       precision it moves along with the vehicle */
    double origin[GBT_DIMENSION];
    int begun; /* whether the tracker was made, at the first navigation */
    gbt_tracker tracker;
    gbt_guidance guidance;
    gbt_intake intake;
    gbt_own_track own;
    gbt_watch watch;
#if GBT_CURRENT
    gbt_current current; /* of the water, as far as it is known */
#endif
    int known;             /* measurements that are remembered to find duplicates */
    struct {
        int sensor;
        gbt_kind kind;
        double time;
    } known_ones[GBT_KNOWN];
    int waiting;
    gbt_measurement waiting_ones[GBT_MEASUREMENTS];
    unsigned received[GBT_ANSWERS];
    int decided, following, held; /* whether it was decided; whether on a plan; whether the forecast was held */
    double decided_at, now;
    int usable_forecast;
    gbt_forecast forecast, usable; /* as the tracker gave it; the last finite one */
    int range_known, planned;
    int commanded;
    gbt_command last;
} gbt_pilot;

/* Nothing seen yet. */
#define gbt_pilot_init GBT_NAME(gbt_pilot_init)
void gbt_pilot_init(gbt_pilot *pilot);

/* Size of a gbt_pilot, for callers that do not see the struct. */
size_t gbt_pilot_bytes(void);

/* Takes in where the vehicle is.

   pose         position and yaw, GBT_POSE: x, y(, z up), m, earth frame, and rad counter-clockwise from +x; of a vehicle
                with fins in space the pitch too, bow up
   velocity     over ground in the body frame, and rates of the angles, GBT_POSE: ahead, to port(, up), m/s and rad/s
   covariance   of the pose, GBT_POSE x GBT_POSE, or 0; the variance of the yaw is added to that of azimuths from the bow */
gbt_received gbt_pilot_navigate(gbt_pilot *pilot, double time, const gbt_real *pose, const gbt_real *velocity,
                                const gbt_real *covariance);

/* The same with the pose in double in both precisions, for a vehicle far from where its coordinates begin. */
gbt_received gbt_pilot_navigate_far(gbt_pilot *pilot, double time, const double *pose, const gbt_real *velocity,
                                    const gbt_real *covariance);

/* Takes in a measurement.

   kind     what was measured
   value    angle in rad, range in m, azimuth and elevation, or position in m: gbt_components(kind) numbers
   sigma    as many standard deviations, or 0 to leave them to what is configured
   sensor   which one, what it refers to and where it sits; 0 is sensor 0 as it is configured
   time     when it was measured, not when it arrived */
gbt_received gbt_pilot_measure(gbt_pilot *pilot, gbt_kind kind, const gbt_real *value, const gbt_real *sigma,
                               const gbt_sensor_pose *sensor, double time);

/* What the vehicle is to do from a time on. The guidance decides once a period, at the command nearest to the time when it
   is due; in between the thrust leads back to the plan from where the vehicle is. */
gbt_command_status gbt_pilot_command(gbt_pilot *pilot, double time, gbt_command *command);

/* Where the vehicle should be at the end of a piece of the plan that is followed, and how it should move there: that of
   the piece in which the last command was given, and so many after it. Returns the time of that, which is not a number
   where there is none; waypoint->status says so too. */
double gbt_pilot_waypoint(const gbt_pilot *pilot, int after, gbt_setpoint *waypoint);

#if GBT_CURRENT
/* The velocity of the water over ground as the pilot knows it, GBT_DIMENSION, earth frame, m/s, and its covariance,
   GBT_DIMENSION x GBT_DIMENSION, m^2/s^2; 0 where the velocity is given. */
void gbt_pilot_current(const gbt_pilot *pilot, gbt_real *velocity, gbt_real *covariance);
#endif

GBT_END_C

#endif
