/* The header must compile as strict C11, before any other. */
#include <endosdk/endosdk.h>

#include <string.h>

/* Numbers and places are the ABI: a change of one of these lines is a break; new ones are added at the end. */
#define VALUE(name, number) _Static_assert(name == number, #name)
#define PLACE(type, field, offset) _Static_assert(offsetof(type, field) == offset, #type "." #field)

VALUE(ENDO_OK, 0);
VALUE(ENDO_INVALID_ARGUMENT, 1);
VALUE(ENDO_INVALID_CALIBRATION, 2);
VALUE(ENDO_CALIBRATION_REQUIRED, 3);
VALUE(ENDO_CALIBRATION_SIZE_MISMATCH, 4);
VALUE(ENDO_CALIBRATION_UNREADABLE, 5);
VALUE(ENDO_MODEL_NOT_FOUND, 6);
VALUE(ENDO_MODEL_UNREADABLE, 7);
VALUE(ENDO_MODEL_METADATA, 8);
VALUE(ENDO_MODEL_HASH_MISMATCH, 9);
VALUE(ENDO_RUNTIME_MISSING, 10);
VALUE(ENDO_PROVIDER_UNAVAILABLE, 12);
VALUE(ENDO_INFERENCE_FAILED, 13);
VALUE(ENDO_DEPENDENCY_MISSING, 15);
VALUE(ENDO_CANCELLED, 18);
VALUE(ENDO_OUT_OF_MEMORY, 19);
VALUE(ENDO_SELF_TEST_FAILED, 20);
VALUE(ENDO_INTERNAL, 21);
VALUE(ENDO_RUNTIME_HASH_MISMATCH, 23);
VALUE(ENDO_LOG_ERROR, 1);
VALUE(ENDO_LOG_WARNING, 2);
VALUE(ENDO_LOG_INFO, 3);
VALUE(ENDO_PINHOLE, 0);
VALUE(ENDO_FISHEYE, 1);
VALUE(ENDO_RGB8, 0);
VALUE(ENDO_BGR8, 1);
VALUE(ENDO_GRAY8, 2);
VALUE(ENDO_REASON_LOW_CONFIDENCE, 1);
VALUE(ENDO_REASON_OCCLUDED, 2);
VALUE(ENDO_REASON_OUTSIDE_OVERLAP, 4);
VALUE(ENDO_REASON_OUT_OF_RANGE, 8);
VALUE(ENDO_REASON_SATURATED, 16);
VALUE(ENDO_REASON_OUTSIDE_VIEW, 32);
VALUE(ENDO_QUALITY_OK, 0);
VALUE(ENDO_QUALITY_DEGRADED, 1);
VALUE(ENDO_QUALITY_INVALID, 2);
VALUE(ENDO_CAUSE_COVERED, 0);
VALUE(ENDO_CAUSE_SATURATED, 1);
VALUE(ENDO_CAUSE_BLURRED, 2);
VALUE(ENDO_CAUSE_DIM, 3);
VALUE(ENDO_CAUSE_FROZEN, 4);
VALUE(ENDO_CAUSE_NOT_SIMULTANEOUS, 5);
VALUE(ENDO_CAUSE_SAME_VIEW_TWICE, 6);
VALUE(ENDO_CAUSE_SWAPPED, 7);
VALUE(ENDO_CAUSE_NOT_RECTIFIED, 8);
VALUE(ENDO_CAUSE_RIG_MOVED, 9);
VALUE(ENDO_CAUSE_OUT_OF_RANGE, 10);
VALUE(ENDO_CAUSE_LOW_TEXTURE, 11);
VALUE(ENDO_CAUSE_LATE, 12);
VALUE(ENDO_CAUSE_VIEWS_DIFFER, 13);
VALUE(ENDO_CAUSE_FEW_VALID, 14);
VALUE(ENDO_CAUSE_STALE, 15);
VALUE(ENDO_CAUSE_REPEATED_PATTERN, 16);
VALUE(ENDO_CAUSE_SCALES_DIFFER, 17);
VALUE(ENDO_CAUSE_INTERLACED, 18);
VALUE(ENDO_CAUSE_DISTORTED, 19);
VALUE(ENDO_MOST_CAUSES, 32);

PLACE(endo_options, struct_size, 0);
PLACE(endo_options, threads, 4);
PLACE(endo_options, spinning, 8);
PLACE(endo_options, log_level, 12);
PLACE(endo_options, provider, 16);
PLACE(endo_options, runtime_library, 24);
PLACE(endo_options, model_sha256, 32);
PLACE(endo_options, log, 40);
PLACE(endo_options, log_context, 48);
PLACE(endo_options, network_width, 56);
PLACE(endo_options, network_height, 60);
PLACE(endo_options, min_confidence, 64);
PLACE(endo_options, min_depth_mm, 72);
PLACE(endo_options, max_depth_mm, 80);
PLACE(endo_options, depth_unit_mm, 88);
PLACE(endo_options, deadline_ms, 96);
PLACE(endo_options, float32_model, 104);
PLACE(endo_options, float32_model_sha256, 112);
PLACE(endo_options, provider_options, 120);
PLACE(endo_options, runtime_sha256, 128);
PLACE(endo_options, max_age_ms, 136);
PLACE(endo_options, public_key, 144);
PLACE(endo_options, public_key_size, 152);
PLACE(endo_options, signature, 160);
PLACE(endo_options, signature_size, 168);
PLACE(endo_options, float32_model_signature, 176);
PLACE(endo_options, float32_model_signature_size, 184);
PLACE(endo_options, crypto_library, 192);
PLACE(endo_options, thread_started, 200);
PLACE(endo_options, thread_context, 208);
_Static_assert(sizeof(endo_options) == 216, "endo_options");

PLACE(endo_calibration, struct_size, 0);
PLACE(endo_calibration, camera_model, 4);
PLACE(endo_calibration, width, 8);
PLACE(endo_calibration, height, 12);
PLACE(endo_calibration, left_distortion_count, 16);
PLACE(endo_calibration, right_distortion_count, 20);
PLACE(endo_calibration, left_matrix, 24);
PLACE(endo_calibration, right_matrix, 96);
PLACE(endo_calibration, left_distortion, 168);
PLACE(endo_calibration, right_distortion, 232);
PLACE(endo_calibration, rotation, 296);
PLACE(endo_calibration, translation, 368);
PLACE(endo_calibration, left_field_of_view, 392);
PLACE(endo_calibration, right_field_of_view, 424);
_Static_assert(sizeof(endo_calibration) == 456, "endo_calibration");

PLACE(endo_geometry, struct_size, 0);
PLACE(endo_geometry, rectifies, 4);
PLACE(endo_geometry, focal_px, 8);
PLACE(endo_geometry, baseline_mm, 16);
PLACE(endo_geometry, cx, 24);
PLACE(endo_geometry, cy, 32);
PLACE(endo_geometry, doffs, 40);
PLACE(endo_geometry, focal_y_px, 48);
_Static_assert(sizeof(endo_geometry) == 56, "endo_geometry");

PLACE(endo_image, struct_size, 0);
PLACE(endo_image, format, 4);
PLACE(endo_image, data, 8);
PLACE(endo_image, width, 16);
PLACE(endo_image, height, 20);
PLACE(endo_image, stride, 24);
_Static_assert(sizeof(endo_image) == 32, "endo_image");

PLACE(endo_result, struct_size, 0);
PLACE(endo_result, quality, 4);
PLACE(endo_result, capacity, 8);
PLACE(endo_result, disparity, 16);
PLACE(endo_result, confidence, 24);
PLACE(endo_result, depth, 32);
PLACE(endo_result, sigma, 40);
PLACE(endo_result, reasons, 48);
PLACE(endo_result, disparity_u16, 56);
PLACE(endo_result, depth_u16, 64);
PLACE(endo_result, frame, 72);
PLACE(endo_result, valid_share, 80);
PLACE(endo_result, rectify_ms, 88);
PLACE(endo_result, session_ms, 96);
PLACE(endo_result, postprocess_ms, 104);
PLACE(endo_result, late, 112);
PLACE(endo_result, reserved, 116);
PLACE(endo_result, causes, 120);
PLACE(endo_result, measures, 128);
PLACE(endo_result, vertical_disparity_px, 384);
PLACE(endo_result, vertical_disparity_se_px, 392);
PLACE(endo_result, rotation_deg, 400);
PLACE(endo_result, rotation_se_deg, 424);
PLACE(endo_result, steady_rotation_deg, 448);
PLACE(endo_result, steady_rotation_se_deg, 472);
PLACE(endo_result, corrected_deg, 496);
PLACE(endo_result, drifted, 520);
PLACE(endo_result, reserved2, 524);
PLACE(endo_result, stamp_ns, 528);
PLACE(endo_result, age_ms, 536);
PLACE(endo_result, identity, 544);
_Static_assert(sizeof(endo_result) == 1056, "endo_result");

PLACE(endo_identity, endosdk, 0);
PLACE(endo_identity, model, 16);
PLACE(endo_identity, model_version, 120);
PLACE(endo_identity, model_sha256, 152);
PLACE(endo_identity, calibration_sha256, 224);
PLACE(endo_identity, runtime, 296);
PLACE(endo_identity, runtime_sha256, 328);
PLACE(endo_identity, provider, 400);
PLACE(endo_identity, device, 440);
_Static_assert(sizeof(endo_identity) == 512, "endo_identity");

PLACE(endo_measured, struct_size, 0);
PLACE(endo_measured, reserved, 4);
PLACE(endo_measured, value, 8);
PLACE(endo_measured, standard_error, 16);
_Static_assert(sizeof(endo_measured) == 24, "endo_measured");

PLACE(endo_point, struct_size, 0);
PLACE(endo_point, reserved, 4);
PLACE(endo_point, xyz, 8);
PLACE(endo_point, covariance, 32);
_Static_assert(sizeof(endo_point) == 104, "endo_point");

PLACE(endo_area, struct_size, 0);
PLACE(endo_area, reserved, 4);
PLACE(endo_area, flat, 8);
PLACE(endo_area, flat_standard_error, 16);
PLACE(endo_area, relief, 24);
PLACE(endo_area, relief_standard_error, 32);
PLACE(endo_area, coverage, 40);
_Static_assert(sizeof(endo_area) == 48, "endo_area");

PLACE(endo_rectification, struct_size, 0);
PLACE(endo_rectification, region, 4);
PLACE(endo_rectification, reserved, 20);
PLACE(endo_rectification, left_rotation, 24);
PLACE(endo_rectification, right_rotation, 96);
PLACE(endo_rectification, left_projection, 168);
PLACE(endo_rectification, right_projection, 264);
PLACE(endo_rectification, q, 360);
_Static_assert(sizeof(endo_rectification) == 488, "endo_rectification");

int main(void) {
    endo_options options;
    if (endo_options_init(&options, sizeof options) != ENDO_OK || options.struct_size != sizeof options) return 1;
    if (strcmp(endo_status_name(ENDO_OK), "OK") != 0 || endo_version()[0] == '\0') return 2;
    if (strcmp(endo_cause_name(ENDO_CAUSE_DIM), "DIM") != 0 || strcmp(endo_cause_name(-1), "UNKNOWN") != 0) return 4;
    return endo_options_init(NULL, sizeof options) == ENDO_INVALID_ARGUMENT ? 0 : 3;
}
