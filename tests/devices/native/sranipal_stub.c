/* A stand-in for HTC's SRanipal library: the functions that a program calls, on a frame that a test
 * puts in. The structures follow the members, types and order of the vendor's public header; where
 * they come to lie is the compiler's doing, which is what the codec is held against.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct { float x, y, z; } Vector3;
typedef struct { float x, y; } Vector2;

typedef struct {
    uint64_t validity;
    Vector3 origin_mm;
    Vector3 direction;
    float pupil_mm;
    float openness;
    Vector2 on_sensor;
} SingleEye;

typedef struct {
    SingleEye eye;
    bool convergence_valid;
    float convergence_mm;
} CombinedEye;

typedef struct { int32_t count; int32_t items[10]; } Improvements;

typedef struct { SingleEye left, right; CombinedEye combined; Improvements improvements; } Verbose;

typedef struct { float wide, squeeze, frown; } SingleExpression;

typedef struct {
    bool no_user;
    int32_t frame_sequence;
    int32_t timestamp;
    Verbose verbose;
    SingleExpression left, right;
} EyeDataV2;

static EyeDataV2 held;
static int32_t start_code, data_code;
static bool is_pro_eye = true;

EXPORT int32_t Initial(int32_t kind, void *config) {
    (void)config;
    return kind == 2 ? start_code : -1;
}

EXPORT int32_t Release(int32_t kind) { return kind == 2 ? 0 : -1; }

EXPORT bool IsViveProEye(void) { return is_pro_eye; }

EXPORT int32_t GetEyeData_v2(EyeDataV2 *data) {
    if (data_code == 0) *data = held;
    return data_code;
}

EXPORT int32_t visavis_size(void) { return (int32_t)sizeof(EyeDataV2); }

EXPORT void visavis_hold(const char *data, int32_t size) {
    memcpy(&held, data, (size_t)size < sizeof held ? (size_t)size : sizeof held);
}

EXPORT void visavis_answer(int32_t start, int32_t data, int32_t pro_eye) {
    start_code = start;
    data_code = data;
    is_pro_eye = pro_eye != 0;
}

EXPORT void visavis_offsets(int32_t *found) {
    found[0] = offsetof(EyeDataV2, frame_sequence);
    found[1] = offsetof(EyeDataV2, timestamp);
    found[2] = offsetof(EyeDataV2, verbose.left);
    found[3] = offsetof(EyeDataV2, verbose.right.pupil_mm);
    found[4] = offsetof(EyeDataV2, verbose.combined.eye);
    found[5] = offsetof(EyeDataV2, verbose.combined.convergence_mm);
    found[6] = offsetof(EyeDataV2, verbose.improvements.items);
    found[7] = offsetof(EyeDataV2, left);
}
