/* The header must compile as strict C11, before any other. */
#include <endosdk/endosdk.h>

#include <string.h>

/* The numbers are the ABI: a change of one of these lines is a break. */
_Static_assert(ENDO_INTERNAL == 21 && ENDO_CANCELLED == 18 && ENDO_INFERENCE_FAILED == 13, "status numbers");
_Static_assert(ENDO_GRAY8 == 2 && ENDO_FISHEYE == 1 && ENDO_REASON_SATURATED == 16, "enum numbers");
_Static_assert(sizeof(endo_options) == 104 && sizeof(endo_calibration) == 392 && sizeof(endo_geometry) == 48 &&
                   sizeof(endo_image) == 32 && sizeof(endo_result) == 120,
               "struct sizes of the first release");
_Static_assert(offsetof(endo_options, deadline_ms) == 96 && offsetof(endo_result, late) == 112, "field places");

int main(void) {
    endo_options options;
    if (endo_options_init(&options, sizeof options) != ENDO_OK || options.struct_size != sizeof options) return 1;
    if (strcmp(endo_status_name(ENDO_OK), "OK") != 0 || endo_version()[0] == '\0') return 2;
    return endo_options_init(NULL, sizeof options) == ENDO_INVALID_ARGUMENT ? 0 : 3;
}
