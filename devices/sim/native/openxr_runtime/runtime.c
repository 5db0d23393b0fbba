/* A stand-in for an OpenXR runtime, loaded by the genuine OpenXR loader.
 *
 * It holds only what the loader needs: the negotiation and a table of functions by name. The
 * functions themselves are the simulator's, in Python; they all return an XrResult.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { SUCCESS = 0, INITIALIZATION_FAILED = -38, FUNCTION_UNSUPPORTED = -7 };
enum { MAX_FUNCTIONS = 128, MAX_NAME = 64, INTERFACE_VERSION = 1 };

typedef struct {
    uint32_t type, version;
    size_t size;
    uint32_t min_interface, max_interface;
    uint64_t min_api, max_api;
} LoaderInfo;

typedef struct {
    uint32_t type, version;
    size_t size;
    uint32_t interface_version;
    uint64_t api_version;
    void *get_instance_proc_addr;
} RuntimeRequest;

static struct {
    char name[MAX_NAME];
    void *function;
} table[MAX_FUNCTIONS];
static int count;

EXPORT void visavis_xr_set_function(const char *name, void *function) {
    int i;
    for (i = 0; i < count; i++)
        if (!strcmp(table[i].name, name)) break;
    if (i == MAX_FUNCTIONS) return;
    if (i == count) strncpy(table[count++].name, name, MAX_NAME - 1);
    table[i].function = function;
}

static int32_t get_instance_proc_addr(void *instance, const char *name, void **function) {
    int i;
    (void)instance;
    *function = 0;
    if (!strcmp(name, "xrGetInstanceProcAddr")) {
        *function = (void *)get_instance_proc_addr;
        return SUCCESS;
    }
    for (i = 0; i < count; i++)
        if (!strcmp(table[i].name, name)) {
            *function = table[i].function;
            return SUCCESS;
        }
    return FUNCTION_UNSUPPORTED;
}

EXPORT int32_t xrNegotiateLoaderRuntimeInterface(const LoaderInfo *info, RuntimeRequest *request) {
    if (!info || !request || info->min_interface > INTERFACE_VERSION ||
        info->max_interface < INTERFACE_VERSION)
        return INITIALIZATION_FAILED;
    request->interface_version = INTERFACE_VERSION;
    request->api_version = ((uint64_t)1 << 48) | ((uint64_t)1 << 32);
    request->get_instance_proc_addr = (void *)get_instance_proc_addr;
    return SUCCESS;
}
