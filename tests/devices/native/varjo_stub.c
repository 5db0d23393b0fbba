/* A stand-in for VarjoLib of native SDK 4: the functions that a program calls, on data that a test
 * puts in. The structures follow the members, types and order of the vendor's header Varjo_types.h;
 * where they come to lie is the compiler's doing, which is what the codec is held against.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct { double origin[3], forward[3]; } Ray;

typedef struct {
    Ray left, right, combined;
    double focus_distance, stability;
    int64_t capture_time, left_status, right_status, status, frame_number;
    double left_pupil_size, right_pupil_size;
} Gaze;

typedef struct {
    int64_t frame_number, capture_time;
    float pupils_apart_mm, left_ratio, right_ratio;
    float left_pupil_mm, right_pupil_mm, left_iris_mm, right_iris_mm;
    float left_openness, right_openness;
} Measurements;

typedef struct { const char *key, *value; } Parameter;

#define MOST 64
static Gaze gazes[MOST];
static Measurements measured[MOST];
static int held;
static int32_t available = 1, allowed = 1, connected = 1, calibrating, calibrated, quality;
static int64_t error, init_error, clock_ns = 123456789;
static char filter[32], frequency[64];
static int sessions;

EXPORT int32_t varjo_IsAvailable(void) { return available; }
EXPORT const char *varjo_GetVersionString(void) { return "4.7.0.11"; }
EXPORT void *varjo_SessionInit(void) { return ++sessions ? &sessions : NULL; }
EXPORT void varjo_SessionShutDown(void *session) { if (session == &sessions) sessions--; }
EXPORT int64_t varjo_GetCurrentTime(void *session) { return session == &sessions ? clock_ns : 0; }
EXPORT int32_t varjo_IsGazeAllowed(void *session) { (void)session; return allowed; }
EXPORT void varjo_GazeInit(void *session) { (void)session; error = 0; }

EXPORT void varjo_GazeInitWithParameters(void *session, const Parameter *asked, int32_t count) {
    (void)session;
    for (int32_t i = 0; i < count; i++) {
        char *kept = strcmp(asked[i].key, "OutputFilterType") == 0 ? filter : frequency;
        size_t size = kept == filter ? sizeof filter : sizeof frequency;
        strncpy(kept, asked[i].value, size - 1);
    }
    error = init_error;
}

EXPORT int64_t varjo_GetError(void *session) {
    int64_t found = error;
    (void)session;
    error = 0;
    return found;
}

EXPORT const char *varjo_GetErrorDesc(int64_t code) { return code == 103 ? "Gaze not allowed" : "?"; }

EXPORT int32_t varjo_GetGazeDataArray(void *session, Gaze *gaze, Measurements *eyes, int32_t most) {
    int32_t count = held < most ? held : most;
    if (session != &sessions) return 0;
    memcpy(gaze, gazes, (size_t)count * sizeof *gaze);
    memcpy(eyes, measured, (size_t)count * sizeof *eyes);
    memmove(gazes, gazes + count, (size_t)(held - count) * sizeof *gaze);
    memmove(measured, measured + count, (size_t)(held - count) * sizeof *eyes);
    held -= count;
    return count;
}

EXPORT void varjo_SyncProperties(void *session) { (void)session; }
EXPORT void varjo_RequestGazeCalibration(void *session) { (void)session; calibrating = 1; }

EXPORT int32_t varjo_GetPropertyBool(void *session, int64_t key) {
    (void)session;
    switch (key) {
    case 0xA000: return calibrating;
    case 0xA001: return calibrated;
    case 0xA003: return allowed;
    case 0xE001: return connected;
    default: return 0;
    }
}

EXPORT int32_t varjo_GetPropertyInt(void *session, int64_t key) {
    (void)session;
    return key == 0xA004 || key == 0xA005 ? quality : 0;
}

EXPORT void visavis_push(const char *data) {
    if (held == MOST) return;
    memcpy(&gazes[held], data, sizeof *gazes);
    memcpy(&measured[held], data + sizeof *gazes, sizeof *measured);
    held++;
}

EXPORT void visavis_set(int32_t there, int32_t may, int64_t at_init, int32_t done, int32_t how) {
    available = there;
    allowed = may;
    init_error = at_init;
    calibrating = 0;
    calibrated = done;
    quality = how;
    held = 0;
}

EXPORT const char *visavis_asked(int32_t which) { return which ? frequency : filter; }
EXPORT int32_t visavis_sessions(void) { return sessions; }

EXPORT void visavis_layout(int32_t *found) {
    found[0] = sizeof(Gaze);
    found[1] = sizeof(Measurements);
    found[2] = offsetof(Gaze, right);
    found[3] = offsetof(Gaze, combined.forward);
    found[4] = offsetof(Gaze, capture_time);
    found[5] = offsetof(Gaze, frame_number);
    found[6] = offsetof(Measurements, left_pupil_mm);
    found[7] = offsetof(Measurements, left_openness);
}
