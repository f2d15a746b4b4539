/* An FMU under test, in C99: FMI 2 with -DFMI=2, FMI 3 with -DFMI=3.

   Co-simulation: y[k] = 0.7 y[k-1] + 0.3 u[k-3], whatever the step.
   Model exchange: T x' = u - x, y = x; once x has come to the level, T x' = -x for good.
   u has value reference 0, y 1, x 2, x' 3, T 4, level 5.

   What a description without options never has called is there by name alone. */
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#define JOIN_(a, b, c) a##b##c
#define JOIN(a, b, c) JOIN_(a, b, c)
#define F(name) JOIN(fmi, FMI, name)
#define ABSENT(name) int F(name)(void) { return 3; }

typedef struct { double v[6], line[3]; bool past; } unit;

static unit *born(void) {
  unit *one = calloc(1, sizeof *one);
  if (one) one->v[4] = 0.05, one->v[5] = 1e9;
  return one;
}
static void slope(unit *m) { m->v[3] = ((m->past ? 0.0 : m->v[0]) - m->v[2]) / m->v[4]; }
static int step(unit *m, double h) {
  if (h <= 0) return 3;
  m->v[1] = 0.7 * m->v[1] + 0.3 * m->line[1]; /* line[i] is u, i + 1 steps ago */
  m->line[1] = m->line[0];
  m->line[0] = m->v[0];
  return 0;
}
static int get(unit *m, const unsigned r[], size_t n, double v[]) {
  slope(m);
  for (size_t i = 0; i < n; i++) v[i] = m->v[r[i]];
  return 0;
}
static int put(unit *m, const unsigned r[], size_t n, const double v[]) {
  for (size_t i = 0; i < n; i++) m->v[r[i]] = v[i];
  return 0;
}

int F(Terminate)(void *m) { (void)m; return 0; }
int F(Reset)(void *m) { (void)m; return 0; }
int F(ExitInitializationMode)(void *m) { (void)m; return 0; }
void F(FreeInstance)(void *m) { free(m); }
int F(SetDebugLogging)(void *m) { (void)m; return 0; }
int F(SetTime)(void *m, double t) { (void)m; (void)t; return 0; }
int F(EnterEventMode)(void *m) { (void)m; return 0; }
int F(EnterContinuousTimeMode)(void *m) { (void)m; return 0; }
int F(GetContinuousStates)(unit *m, double x[], size_t n) { (void)n; x[0] = m->v[2]; return 0; }
int F(SetContinuousStates)(unit *m, const double x[], size_t n) {
  (void)n;
  m->v[1] = m->v[2] = x[0];
  return 0;
}
int F(GetNominalsOfContinuousStates)(void *m, double x[], size_t n) {
  (void)m; (void)n;
  x[0] = 1.0;
  return 0;
}
int F(GetEventIndicators)(unit *m, double z[], size_t n) {
  (void)n;
  z[0] = m->past ? 1.0 : m->v[2] - m->v[5];
  return 0;
}
ABSENT(GetString) ABSENT(SetString) ABSENT(GetBoolean) ABSENT(SetBoolean)
ABSENT(GetDirectionalDerivative)

#if FMI == 2
typedef struct { int again, ended, nominals, values, defined; double next; } event;
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(void) { return born(); }
int fmi2SetupExperiment(void *m) { (void)m; return 0; }
int fmi2EnterInitializationMode(void *m) { (void)m; return 0; }
int fmi2GetReal(unit *m, const unsigned r[], size_t n, double v[]) { return get(m, r, n, v); }
int fmi2SetReal(unit *m, const unsigned r[], size_t n, const double v[]) { return put(m, r, n, v); }
int fmi2DoStep(unit *m, double t, double h, int no) { (void)t; (void)no; return step(m, h); }
int fmi2NewDiscreteStates(unit *m, event *e) {
  m->past = m->past || m->v[2] > m->v[5];
  *e = (event){0};
  return 0;
}
int fmi2CompletedIntegratorStep(void *m, int no, int *enter, int *end) {
  (void)m; (void)no;
  *enter = *end = 0;
  return 0;
}
int fmi2GetDerivatives(unit *m, double x[], size_t n) { (void)n; slope(m); x[0] = m->v[3]; return 0; }
ABSENT(GetInteger) ABSENT(SetInteger) ABSENT(GetFMUstate) ABSENT(SetFMUstate) ABSENT(FreeFMUstate)
ABSENT(SerializedFMUstateSize) ABSENT(SerializeFMUstate) ABSENT(DeSerializeFMUstate)
ABSENT(SetRealInputDerivatives) ABSENT(GetRealOutputDerivatives) ABSENT(CancelStep)
ABSENT(GetStatus) ABSENT(GetRealStatus) ABSENT(GetIntegerStatus) ABSENT(GetBooleanStatus)
ABSENT(GetStringStatus)
#else
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(void) { return born(); }
void *fmi3InstantiateModelExchange(void) { return born(); }
int fmi3EnterInitializationMode(void *m) { (void)m; return 0; }
int fmi3EnterStepMode(void *m) { (void)m; return 0; }
int fmi3GetFloat64(unit *m, const unsigned r[], size_t n, double v[], size_t k) {
  (void)k;
  return get(m, r, n, v);
}
int fmi3SetFloat64(unit *m, const unsigned r[], size_t n, const double v[], size_t k) {
  (void)k;
  return put(m, r, n, v);
}
int fmi3DoStep(unit *m, double t, double h, bool no, bool *event, bool *end, bool *early, double *at) {
  (void)no;
  *event = *end = *early = false;
  *at = t + h;
  return step(m, h);
}
int fmi3UpdateDiscreteStates(unit *m, bool *a, bool *b, bool *c, bool *d, bool *e, double *next) {
  m->past = m->past || m->v[2] > m->v[5];
  *a = *b = *c = *d = *e = false;
  *next = 0;
  return 0;
}
int fmi3CompletedIntegratorStep(void *m, bool no, bool *enter, bool *end) {
  (void)m; (void)no;
  *enter = *end = false;
  return 0;
}
int fmi3GetContinuousStateDerivatives(unit *m, double x[], size_t n) {
  (void)n;
  slope(m);
  x[0] = m->v[3];
  return 0;
}
int fmi3GetNumberOfContinuousStates(void *m, size_t *n) { (void)m; *n = 1; return 0; }
int fmi3GetNumberOfEventIndicators(void *m, size_t *n) { (void)m; *n = 1; return 0; }
ABSENT(InstantiateScheduledExecution) ABSENT(GetFloat32) ABSENT(SetFloat32) ABSENT(GetInt8)
ABSENT(SetInt8) ABSENT(GetUInt8) ABSENT(SetUInt8) ABSENT(GetInt16) ABSENT(SetInt16)
ABSENT(GetUInt16) ABSENT(SetUInt16) ABSENT(GetInt32) ABSENT(SetInt32) ABSENT(GetUInt32)
ABSENT(SetUInt32) ABSENT(GetInt64) ABSENT(SetInt64) ABSENT(GetUInt64) ABSENT(SetUInt64)
ABSENT(GetBinary) ABSENT(SetBinary) ABSENT(GetClock) ABSENT(SetClock)
ABSENT(GetNumberOfVariableDependencies) ABSENT(GetVariableDependencies) ABSENT(GetFMUState)
ABSENT(SetFMUState) ABSENT(FreeFMUState) ABSENT(SerializedFMUStateSize) ABSENT(SerializeFMUState)
ABSENT(DeserializeFMUState) ABSENT(GetAdjointDerivative) ABSENT(EnterConfigurationMode)
ABSENT(ExitConfigurationMode) ABSENT(GetIntervalDecimal) ABSENT(GetIntervalFraction)
ABSENT(GetShiftDecimal) ABSENT(GetShiftFraction) ABSENT(SetIntervalDecimal)
ABSENT(SetIntervalFraction) ABSENT(SetShiftDecimal) ABSENT(SetShiftFraction)
ABSENT(EvaluateDiscreteStates) ABSENT(GetOutputDerivatives) ABSENT(ActivateModelPartition)
#endif
