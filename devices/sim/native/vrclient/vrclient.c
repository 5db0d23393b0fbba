/* A stand-in for SteamVR's client library, loaded by the genuine openvr_api.
 *
 * It holds the function tables that the openvr package asks for. `tables.h` is generated from
 * that package's own definitions. Most functions are put in by the simulator in Python; here are
 * only those that return structures by value, which Python cannot, and a default for every slot
 * that nobody models: it returns zero and leaves its name to be asked for.
 */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "tables.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { INIT_NONE = 0, INIT_INTERFACE_NOT_FOUND = 105 };

typedef struct { float m[3][4]; } Matrix34;
typedef struct { float m[4][4]; } Matrix44;
typedef struct { float v[2]; } Vector2;
typedef struct { const Vector2 *corners; uint32_t triangles; } HiddenArea;

static const char *last_unmodelled = "";

#define DEFINE_UNMODELLED(table, name) \
    static uint64_t unmodelled_##table##_##name(void) { \
        last_unmodelled = #table "." #name; \
        return 0; \
    }
SYSTEM_SLOTS(DEFINE_UNMODELLED)
COMPOSITOR_SLOTS(DEFINE_UNMODELLED)

#define POINTER_TO(table, name) (void *)unmodelled_##table##_##name,
static void *system_table[] = {SYSTEM_SLOTS(POINTER_TO)};
static void *compositor_table[] = {COMPOSITOR_SLOTS(POINTER_TO)};

static Matrix34 eye_to_head[2];
static float raw_tangents[2][4]; /* left, right, top, bottom, as getProjectionRaw gives them */
enum { MAX_CORNERS = 64 };
static Vector2 hidden_corners[2][MAX_CORNERS]; /* shares of a view, from its left and from below */
static uint32_t hidden_triangles[2];
static const Matrix34 identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
static int32_t init_error = INIT_NONE;
static bool speaks_other_version = false;

static Matrix34 get_eye_to_head(int32_t eye) { return eye_to_head[eye != 0]; }

static HiddenArea get_hidden_area(int32_t eye, int32_t kind) {
    const HiddenArea none = {0, 0}, told = {hidden_corners[eye != 0], hidden_triangles[eye != 0]};
    return kind == 0 && told.triangles ? told : none;
}

static Matrix34 get_identity(void) { return identity; }

static Matrix34 get_matrix_property(uint32_t slot, int32_t property, int32_t *error) {
    (void)slot;
    (void)property;
    if (error) *error = 4; /* TrackedProp_UnknownProperty */
    return identity;
}

static Matrix44 get_projection(int32_t eye, float near_m, float far_m) {
    const float *t = raw_tangents[eye != 0];
    const float width = t[1] - t[0], height = t[3] - t[2], depth = far_m - near_m;
    Matrix44 p;
    memset(&p, 0, sizeof p);
    p.m[0][0] = 2 / width;
    p.m[0][2] = (t[1] + t[0]) / width;
    p.m[1][1] = 2 / height;
    p.m[1][2] = (t[3] + t[2]) / height;
    p.m[2][2] = -far_m / depth;
    p.m[2][3] = -far_m * near_m / depth;
    p.m[3][2] = -1;
    return p;
}

enum { MODEL = 1001, SERIAL = 1002, MAKER = 1005, MAX_SLOTS = 64, MAX_TEXT = 64 };

static char texts[MAX_SLOTS][3][MAX_TEXT]; /* serial, model, maker */

static uint32_t get_string(
    uint32_t slot, int32_t property, char *text, uint32_t size, int32_t *error) {
    const int which = property == SERIAL ? 0 : property == MODEL ? 1 : property == MAKER ? 2 : -1;
    uint32_t needed;
    if (slot >= MAX_SLOTS || which < 0 || !texts[slot][0][0]) {
        if (error) *error = 4; /* TrackedProp_UnknownProperty */
        return 0;
    }
    needed = (uint32_t)strlen(texts[slot][which]) + 1;
    if (error) *error = size < needed ? 3 : 0; /* TrackedProp_BufferTooSmall */
    if (size >= needed) memcpy(text, texts[slot][which], needed);
    return needed;
}

static const char *get_runtime_version(void) { return "Visavis simulated runtime 1"; }

/* ---- what the simulator in Python calls ------------------------------------------------- */

EXPORT void visavis_vr_set_function(int32_t is_compositor, int32_t slot, void *function) {
    (is_compositor ? compositor_table : system_table)[slot] = function;
}

EXPORT void visavis_vr_set_eye(int32_t eye, const float *matrix, const float *tangents) {
    memcpy(&eye_to_head[eye != 0], matrix, sizeof(Matrix34));
    memcpy(raw_tangents[eye != 0], tangents, sizeof raw_tangents[0]);
}

EXPORT void visavis_vr_set_hidden(int32_t eye, const float *corners, uint32_t triangles) {
    hidden_triangles[eye != 0] = triangles;
    memcpy(hidden_corners[eye != 0], corners, 3 * triangles * sizeof(Vector2));
}

EXPORT void visavis_vr_set_text(uint32_t slot, int32_t which, const char *text) {
    strncpy(texts[slot][which], text, MAX_TEXT - 1);
}

EXPORT void visavis_vr_set_init(int32_t error, int32_t other_version) {
    init_error = error;
    speaks_other_version = other_version != 0;
}

EXPORT const char *visavis_vr_last_unmodelled(void) { return last_unmodelled; }

/* ---- IVRClientCore_003 ------------------------------------------------------------------ */

typedef struct Client Client;

typedef struct {
    int32_t (*init)(Client *, int32_t, const char *);
    void (*cleanup)(Client *);
    int32_t (*is_interface_version_valid)(Client *, const char *);
    void *(*get_generic_interface)(Client *, const char *, int32_t *);
    bool (*is_hmd_present)(Client *);
    const char *(*english_string_for_error)(Client *, int32_t);
    const char *(*id_for_error)(Client *, int32_t);
} ClientFunctions;

struct Client { const ClientFunctions *functions; };

static int32_t client_init(Client *client, int32_t application, const char *startup_info) {
    (void)client;
    (void)application;
    (void)startup_info;
    return init_error;
}

static void client_cleanup(Client *client) { (void)client; }

static void **table_of(const char *version) {
    if (!strncmp(version, "FnTable:", 8)) version += 8;
    if (speaks_other_version) return 0;
    if (!strcmp(version, SYSTEM_VERSION)) return system_table;
    if (!strcmp(version, COMPOSITOR_VERSION)) return compositor_table;
    return 0;
}

static int32_t client_is_valid(Client *client, const char *version) {
    (void)client;
    return table_of(version) ? INIT_NONE : INIT_INTERFACE_NOT_FOUND;
}

static void *client_get_interface(Client *client, const char *version, int32_t *error) {
    void **table = table_of(version);
    (void)client;
    if (error) *error = table ? INIT_NONE : INIT_INTERFACE_NOT_FOUND;
    return table;
}

static bool client_is_hmd_present(Client *client) {
    (void)client;
    return init_error == INIT_NONE;
}

static const char *client_string(Client *client, int32_t error) {
    (void)client;
    return error ? "refused by the simulated runtime" : "no error";
}

static const ClientFunctions functions = {
    client_init,          client_cleanup, client_is_valid, client_get_interface,
    client_is_hmd_present, client_string, client_string,
};
static Client the_client = {&functions};

EXPORT void *VRClientCoreFactory(const char *interface_name, int32_t *error) {
    const bool known = !strcmp(interface_name, "IVRClientCore_003");
    system_table[SLOT_SYSTEM_getEyeToHeadTransform] = (void *)get_eye_to_head;
    system_table[SLOT_SYSTEM_getHiddenAreaMesh] = (void *)get_hidden_area;
    system_table[SLOT_SYSTEM_getProjectionMatrix] = (void *)get_projection;
    system_table[SLOT_SYSTEM_getSeatedZeroPoseToStandingAbsoluteTrackingPose] =
        (void *)get_identity;
    system_table[SLOT_SYSTEM_getRawZeroPoseToStandingAbsoluteTrackingPose] = (void *)get_identity;
    system_table[SLOT_SYSTEM_getMatrix34TrackedDeviceProperty] = (void *)get_matrix_property;
    system_table[SLOT_SYSTEM_getStringTrackedDeviceProperty] = (void *)get_string;
    system_table[SLOT_SYSTEM_getRuntimeVersion] = (void *)get_runtime_version;
    if (error) *error = known ? INIT_NONE : INIT_INTERFACE_NOT_FOUND;
    return known ? &the_client : 0;
}
