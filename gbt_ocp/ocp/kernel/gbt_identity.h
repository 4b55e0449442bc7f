/* What distinguishes planners in one program: nothing, where each is loaded by itself. A generated folder has a header of
   its own in this place. */
#define GBT_IDENTITY
