/* The model behind every wrapper of the FMI standard: modes, contacts, films, time integration.

   All state lies in one block of plain memory without pointers, so that copying it saves it.
   Value references are those of klack.exchange.fmu.variables; all variables are reals.
   Functions return 0, or 1 when something failed; klack_message then says what.            */
#ifndef KLACK_MODEL_H
#define KLACK_MODEL_H

#include <stddef.h>

typedef struct klack_model klack_model;

size_t klack_size(void);                          /* bytes of one model */
void klack_reset(klack_model *m);                 /* parameters, states and inputs as at first */
const char *klack_message(const klack_model *m);  /* reason of the last failure */

/* counts of this model: compile-time constants of klack_data.h behind functions */
unsigned klack_variable_count(void);
unsigned klack_state_count(void);                 /* 2 x modes, and states of films if there are */
unsigned klack_event_count(void);                 /* one indicator per contact */

int klack_set_real(klack_model *m, unsigned reference, double value);
int klack_get_real(klack_model *m, unsigned reference, double *value);

/* after parameters are set, before the first step; applies start_velocity and start_rise */
int klack_initialize(klack_model *m, double start_time);

/* model exchange; states in the order of their value references */
int klack_set_time(klack_model *m, double time);
int klack_set_states(klack_model *m, const double *x);
int klack_get_states(klack_model *m, double *x);
int klack_get_derivatives(klack_model *m, double *dx);
int klack_get_nominals(klack_model *m, double *nominal);
int klack_get_events(klack_model *m, double *indicator); /* above zero: open */
int klack_complete_step(klack_model *m);                 /* an accepted step of the integrator */

/* co-simulation: inputs are held over the step; exact propagation of all modes, contact forces
   by discrete gradients, in equal internal steps no longer than internal_step */
int klack_do_step(klack_model *m, double time, double step);

/* derivative of output i with respect to the known states and inputs */
int klack_directional(klack_model *m, unsigned unknown, unsigned known, double *value);

#endif
