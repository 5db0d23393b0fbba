/* A FoveClient of our own: the functions Visavis calls, fed through fove_stub_*.
 *
 * Names, types and codes follow FOVE SDK 1.4.0. One eye frame (the bytes of fove_codec.EYE_FRAME)
 * is held; fetching copies it, and every getter answers from the copy with the code it holds.
 */
#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

typedef struct { float x, y, z; } Vec3;
typedef struct { Vec3 origin, direction; } Ray;
typedef struct { uint64_t id, us; } FrameTimestamp;
typedef struct {
    int client_major, client_minor, client_build, client_year, client_month, client_day;
    int client_protocol;
    char client_hash[64];
    int runtime_major, runtime_minor, runtime_build, runtime_year, runtime_month, runtime_day;
    char runtime_hash[64];
    int firmware, max_firmware, min_firmware;
    bool too_old_headset;
} Versions;

#pragma pack(push, 1)
typedef struct { int32_t code; Vec3 ray; int32_t state_code, state, radius_code; float radius; } EyePart;
typedef struct {
    uint64_t id, us;
    EyePart eye[2];
    int32_t ray_code;
    Vec3 origin, direction;
} Frame;
#pragma pack(pop)

enum { OK = 0, NOT_CONNECTED = 7, NOT_REGISTERED = 104, TIMED_OUT = 130, NO_UPDATE = 1003, GONE = 2006 };
enum { STEP_TICKS = 3, MAX_FAULTS = 16 };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t news = PTHREAD_COND_INITIALIZER;
static Frame newest, fetched;
static bool any, connected = true, calibrated;
static uint64_t pushes, seen;
static int capabilities, calibration, ticks, quality = 5;
static struct { char name[48]; int code; } faults[MAX_FAULTS];

static int fault(const char *name) {
    for (int i = 0; i < MAX_FAULTS; i++)
        if (faults[i].code && !strcmp(faults[i].name, name)) return faults[i].code;
    return OK;
}

void fove_stub_reset(void) {
    pthread_mutex_lock(&lock);
    memset(faults, 0, sizeof faults);
    any = calibrated = false;
    connected = true;
    capabilities = calibration = ticks = 0;
    quality = 5;
    seen = pushes;
    pthread_mutex_unlock(&lock);
}

void fove_stub_push(const void *frame) {
    pthread_mutex_lock(&lock);
    memcpy(&newest, frame, sizeof newest);
    any = true;
    pushes++;
    pthread_cond_broadcast(&news);
    pthread_mutex_unlock(&lock);
}

void fove_stub_fail(const char *name, int code) {
    pthread_mutex_lock(&lock);
    int at = -1;
    for (int i = 0; i < MAX_FAULTS && at < 0; i++)
        if (!faults[i].code || !strcmp(faults[i].name, name)) at = i;
    if (at >= 0) {
        snprintf(faults[at].name, sizeof faults[at].name, "%s", name);
        faults[at].code = code;
    }
    pthread_mutex_unlock(&lock);
}

void fove_stub_connected(int is) { connected = is; }
void fove_stub_quality(int state) { quality = state; }

int fove_createHeadset(int caps, void **out) {
    *out = (void *)&newest;
    capabilities |= caps;
    return fault("createHeadset");
}

int fove_Headset_destroy(void *h) { (void)h; return OK; }

int fove_Headset_registerCapabilities(void *h, int caps) {
    (void)h;
    capabilities |= caps; /* succeeds even when the service is down */
    return fault("registerCapabilities");
}

int fove_Headset_waitForProcessedEyeFrame(void *h) {
    (void)h;
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += 200000000;
    if (until.tv_nsec >= 1000000000) { until.tv_sec++; until.tv_nsec -= 1000000000; }
    pthread_mutex_lock(&lock);
    int code = fault("waitForProcessedEyeFrame");
    while (code == OK && seen == pushes && connected)
        if (pthread_cond_timedwait(&news, &lock, &until) == ETIMEDOUT) code = TIMED_OUT;
    seen = pushes;
    if (!connected) code = GONE;
    pthread_mutex_unlock(&lock);
    return code;
}

int fove_Headset_fetchEyeTrackingData(void *h, FrameTimestamp *out) {
    (void)h;
    pthread_mutex_lock(&lock);
    int code = fault("fetchEyeTrackingData");
    if (!(capabilities & 8)) code = NOT_REGISTERED;
    else if (!code && !any) code = NO_UPDATE;
    if (!code) {
        fetched = newest;
        out->id = fetched.id;
        out->us = fetched.us;
    }
    pthread_mutex_unlock(&lock);
    return code;
}

int fove_Headset_getGazeVector(void *h, int eye, Vec3 *out) {
    (void)h;
    *out = fetched.eye[eye].ray;
    int code = fault("getGazeVector");
    return code ? code : fetched.eye[eye].code;
}

int fove_Headset_getEyeState(void *h, int eye, int *out) {
    (void)h;
    *out = fetched.eye[eye].state;
    int code = fault("getEyeState");
    return code ? code : fetched.eye[eye].state_code;
}

int fove_Headset_getPupilRadius(void *h, int eye, float *out) {
    (void)h;
    if (!(capabilities & (1 << 14))) return NOT_REGISTERED;
    *out = fetched.eye[eye].radius;
    int code = fault("getPupilRadius");
    return code ? code : fetched.eye[eye].radius_code;
}

int fove_Headset_getCombinedGazeRay(void *h, Ray *out) {
    (void)h;
    out->origin = fetched.origin;
    out->direction = fetched.direction;
    int code = fault("getCombinedGazeRay");
    return code ? code : fetched.ray_code;
}

int fove_Headset_isHardwareConnected(void *h, bool *out) {
    (void)h;
    *out = connected;
    return fault("isHardwareConnected");
}

int fove_Headset_isUserPresent(void *h, bool *out) { (void)h; *out = connected; return fault("isUserPresent"); }

int fove_Headset_isEyeTrackingCalibrated(void *h, bool *out) {
    (void)h;
    *out = calibrated;
    return fault("isEyeTrackingCalibrated");
}

int fove_Headset_startEyeTrackingCalibration(void *h, const void *options) {
    (void)h;
    (void)options;
    calibration = 1;
    ticks = 0;
    return fault("startEyeTrackingCalibration");
}

int fove_Headset_getEyeTrackingCalibrationState(void *h, int *out) {
    (void)h;
    if (calibration > 0 && calibration < 5 && ++ticks % STEP_TICKS == 0) {
        calibration = calibration == 4 ? quality : calibration + 1;
        if (calibration >= 5 && calibration <= 7) calibrated = true;
    }
    *out = calibration;
    return fault("getEyeTrackingCalibrationState");
}

int fove_Headset_getSoftwareVersions(void *h, Versions *out) {
    (void)h;
    memset(out, 0xff, sizeof *out); /* every byte that the header has is written */
    memset(out->client_hash, 'c', 63);
    memset(out->runtime_hash, 'r', 63);
    out->client_major = 1;
    out->client_minor = 4;
    out->client_build = out->runtime_build = 0;
    out->runtime_major = 1;
    out->runtime_minor = 4;
    return fault("getSoftwareVersions");
}

int fove_Headset_checkSoftwareVersions(void *h) { (void)h; return fault("checkSoftwareVersions"); }
