/* An OpenXR runtime that can be asked what it offers, and nothing else; for doctor's tests.
 *
 * NAME is what it is called, GAZE whether its headset tracks eyes, EXTENSION what it has beside the
 * standard's extension for gaze (empty for none), HEADSET whether one is there.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
enum { SUCCESS = 0, NO_FORM_FACTOR = -35, UNSUPPORTED = -7, INITIALIZATION_FAILED = -38 };

typedef struct { int32_t type; void *next; char name[128]; uint32_t version; } Extension;
typedef struct { int32_t type; void *next; uint64_t version; char name[128]; } InstanceProperties;
typedef struct Chained { int32_t type; struct Chained *next; uint32_t flag; } Chained;
typedef struct {
    uint32_t type, version;
    size_t size;
    uint32_t interface_version;
    uint64_t api_version;
    void *get_instance_proc_addr;
} Request;

static const char *const extensions[] = {"XR_EXT_eye_gaze_interaction", EXTENSION};

static int32_t enumerate(const char *layer, uint32_t capacity, uint32_t *count, Extension *found) {
    uint32_t i, n = strlen(EXTENSION) ? 2 : 1;
    (void)layer;
    *count = n;
    for (i = 0; i < n && i < capacity && found; i++) {
        strncpy(found[i].name, extensions[i], 127);
        found[i].version = 1;
    }
    return SUCCESS;
}

static int32_t create(const void *info, uint64_t *instance) {
    (void)info;
    *instance = 7;
    return SUCCESS;
}

static int32_t destroy(uint64_t instance) {
    (void)instance;
    return SUCCESS;
}

static int32_t properties(uint64_t instance, InstanceProperties *told) {
    (void)instance;
    strncpy(told->name, NAME, 127);
    return SUCCESS;
}

static int32_t get_system(uint64_t instance, const void *info, uint64_t *system) {
    (void)instance, (void)info;
    *system = 1;
    return HEADSET ? SUCCESS : NO_FORM_FACTOR;
}

static int32_t system_properties(uint64_t instance, uint64_t system, Chained *told) {
    Chained *each;
    (void)instance, (void)system;
    for (each = told->next; each; each = each->next) each->flag = GAZE;
    return SUCCESS;
}

static int32_t lookup(uint64_t instance, const char *name, void **function) {
    static const struct { const char *name; void *function; } table[] = {
        {"xrGetInstanceProcAddr", (void *)lookup},
        {"xrEnumerateInstanceExtensionProperties", (void *)enumerate},
        {"xrCreateInstance", (void *)create},
        {"xrDestroyInstance", (void *)destroy},
        {"xrGetInstanceProperties", (void *)properties},
        {"xrGetSystem", (void *)get_system},
        {"xrGetSystemProperties", (void *)system_properties},
    };
    size_t i;
    (void)instance;
    for (i = 0; i < sizeof table / sizeof *table; i++)
        if (!strcmp(table[i].name, name)) {
            *function = table[i].function;
            return SUCCESS;
        }
    *function = NULL;
    return UNSUPPORTED;
}

EXPORT int32_t xrNegotiateLoaderRuntimeInterface(const void *info, Request *request) {
    if (!info || !request) return INITIALIZATION_FAILED;
    request->interface_version = 1;
    request->api_version = ((uint64_t)1 << 48) | ((uint64_t)1 << 32);
    request->get_instance_proc_addr = (void *)lookup;
    return SUCCESS;
}
