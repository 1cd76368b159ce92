/* A controller that misbehaves: switches, what it hears and says, its bytes, and a rotor that carries masses. */
#ifndef MISCHIEF_H
#define MISCHIEF_H
#include "firmware.h"

/* mischief.c: KIND[=VALUE][@START], START in seconds after the rotor was first levitated, else from power-on */
extern int64_t levitated_at;                     /* ms; -1: not yet */
int switched(const char *text);                  /* take a switch from the command line; 0: it is none */
const double *on(const char *kind);              /* its value, while it is at work */
int now_and_then(const char *kind);              /* for a share of the times that it is asked */
int once(const char *kind);                      /* at the first time that it is asked while at work */
double uniform(double low, double high);
double normal(double sigma);
void obey_message(int identifier, const uint8_t *m, int length);       /* controller.c's take_message */
void say_message(int identifier, const uint8_t *payload, int length);  /* controller.c's send_message */
void late_messages(int64_t ms);                  /* what slowreply holds back */

/* rotor.c: statics of a rigid shaft in two AMBs, with a lag */
extern double hung_kg;
void make_rotor(unsigned seed, double k_i, double k_o);
void rotor_millisecond(void);
void rotor_readings(uint8_t *telemetry);

#endif
