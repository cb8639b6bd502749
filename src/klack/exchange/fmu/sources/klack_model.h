/* The model behind every wrapper of the FMI standard: modes, contacts, films, time integration.

   All state lies in one block of plain memory without pointers, so that copying it saves it.
   Value references are those of klack.exchange.fmu.variables; all variables are reals.
   Functions return 0, or 1 when something failed; klack_message then says what.
   KLACK_SYMBOL of klack_data.h puts the name of the model before every function, so that several
   models can be linked into one program.                                                      */
#ifndef KLACK_MODEL_H
#define KLACK_MODEL_H

#include <stddef.h>

#include "klack_data.h"

#define klack_size KLACK_SYMBOL(klack_size)
#define klack_reset KLACK_SYMBOL(klack_reset)
#define klack_check KLACK_SYMBOL(klack_check)
#define klack_message KLACK_SYMBOL(klack_message)
#define klack_variable_count KLACK_SYMBOL(klack_variable_count)
#define klack_state_count KLACK_SYMBOL(klack_state_count)
#define klack_event_count KLACK_SYMBOL(klack_event_count)
#define klack_has_model_exchange KLACK_SYMBOL(klack_has_model_exchange)
#define klack_set_real KLACK_SYMBOL(klack_set_real)
#define klack_get_real KLACK_SYMBOL(klack_get_real)
#define klack_get_time KLACK_SYMBOL(klack_get_time)
#define klack_initialize KLACK_SYMBOL(klack_initialize)
#define klack_set_time KLACK_SYMBOL(klack_set_time)
#define klack_set_states KLACK_SYMBOL(klack_set_states)
#define klack_get_states KLACK_SYMBOL(klack_get_states)
#define klack_get_derivatives KLACK_SYMBOL(klack_get_derivatives)
#define klack_get_nominals KLACK_SYMBOL(klack_get_nominals)
#define klack_get_events KLACK_SYMBOL(klack_get_events)
#define klack_update_events KLACK_SYMBOL(klack_update_events)
#define klack_complete_step KLACK_SYMBOL(klack_complete_step)
#define klack_do_step KLACK_SYMBOL(klack_do_step)
#define klack_directional KLACK_SYMBOL(klack_directional)

typedef struct klack_model klack_model;

size_t klack_size(void);                          /* bytes of one model */
void klack_reset(klack_model *m);                 /* parameters, states and inputs as at first */
int klack_check(klack_model *m);                  /* 0 if memory read from outside can be a model */
const char *klack_message(const klack_model *m);  /* reason of the last failure */

/* counts of this model: compile-time constants of klack_data.h behind functions */
unsigned klack_variable_count(void);
unsigned klack_state_count(void);                 /* 2 x modes */
unsigned klack_event_count(void);                 /* one indicator per contact */
int klack_has_model_exchange(void);               /* 0: only co-simulation, see klack_data.h */

/* inputs at any time; parameters and states before klack_initialize; nothing else can be set.
   start_velocity and start_rise act on the states at once                                    */
int klack_set_real(klack_model *m, unsigned reference, double value);
int klack_get_real(klack_model *m, unsigned reference, double *value);
double klack_get_time(const klack_model *m);

/* after parameters are set, before the first step */
int klack_initialize(klack_model *m, double start_time);

/* model exchange; states in the order of their value references */
int klack_set_time(klack_model *m, double time);
int klack_set_states(klack_model *m, const double *x);
int klack_get_states(klack_model *m, double *x);
int klack_get_derivatives(klack_model *m, double *dx);
int klack_get_nominals(klack_model *m, double *nominal);
int klack_get_events(klack_model *m, double *indicator); /* above zero: open */
int klack_update_events(klack_model *m);                 /* in event mode: first touch, release */
int klack_complete_step(klack_model *m);                 /* an accepted step of the integrator */

/* co-simulation: inputs are held over the step; exact propagation of all modes, contact forces
   by discrete gradients, in equal internal steps no longer than internal_step; time is where the
   last step ended, and a step of 0 changes nothing.  Returns 1 for a step that cannot be asked
   for, and 2 when the motion is lost: only klack_reset helps then                            */
int klack_do_step(klack_model *m, double time, double step);

/* derivative of the output or rate unknown with respect to the state or input known */
int klack_directional(klack_model *m, unsigned unknown, unsigned known, double *value);

#endif
