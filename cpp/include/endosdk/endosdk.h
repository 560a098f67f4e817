/* endosdk: depth from a stereo endoscope, frame by frame. The C interface (C11) of libendosdk.

A complete program, for a rig whose frames are already rectified:

    #include <endosdk/endosdk.h>
    #include <stdio.h>
    #include <stdlib.h>

    static uint8_t left_pixels[720 * 960 * 3], right_pixels[720 * 960 * 3];
    static float disparity[720 * 960];
    static uint8_t reasons[720 * 960];

    int main(void) {
        endo_options options;
        endo_options_init(&options, sizeof options);
        endo_estimator *estimator = NULL;
        if (endo_open_file("fast.onnx", &options, &estimator) != ENDO_OK || endo_prepare(estimator, 960, 720) != ENDO_OK) {
            fprintf(stderr, "%s\n", endo_last_error());
            return EXIT_FAILURE;
        }
        const int middle = 360 * 960 + 480;
        endo_image left = {sizeof left, ENDO_RGB8, left_pixels, 960, 720, 0};
        endo_image right = {sizeof right, ENDO_RGB8, right_pixels, 960, 720, 0};
        endo_result result = {.struct_size = sizeof result, .capacity = 960 * 720,
                              .disparity = disparity, .reasons = reasons};
        while (fread(left_pixels, sizeof left_pixels, 1, stdin) == 1 &&
               fread(right_pixels, sizeof right_pixels, 1, stdin) == 1) {
            if (endo_predict(estimator, &left, &right, &result) != ENDO_OK) {
                fprintf(stderr, "%s\n", endo_last_error());
            } else if (result.quality != ENDO_QUALITY_INVALID && reasons[middle] == 0) {
                printf("frame %d: %.1f px in the middle\n", (int)result.frame, disparity[middle]);
            }
        }
        endo_close(estimator);
        return EXIT_SUCCESS;
    }

Ownership. Whatever you pass in stays yours and is not kept after the call, with two exceptions: the log and thread
functions and their contexts must live until endo_close, and a result that was submitted to a stream, with its maps, until
it is received.
Images are read only during endo_predict or endo_stream_submit. Strings returned by the library belong to it and must not
be freed. An estimator is yours from endo_open_* to endo_close.

Threads. Calls on one estimator may come from any thread and run one after the other, in the order in which they came;
endo_cancel and endo_get_diagnostics do not wait. Two estimators work in parallel. endo_last_error belongs to the calling
thread. A thread that calls the library needs 256 KB of stack.

Errors. A function that can fail returns a status, and endo_last_error() says which argument broke which rule with what
value. A failed call leaves the estimator as it was, and usable. No exception leaves this library, and it never ends the
process. ONNX Runtime can, where memory runs out or its file is damaged: pin it by options.runtime_sha256.

Structs begin with struct_size, which you set to sizeof the struct: the library then knows which fields you know. Fields
are only ever appended. A field that your library does not know must be zero, else the call is refused.

Units: pixels, millimetres, milliseconds. Pixel (0, 0) is the centre of the first pixel. x_right = x_left - disparity.

Networks and files: the library opens no socket, and no file but the model, ONNX Runtime's own library and, for the name of
the processor, /proc/cpuinfo; where a signature is checked, also libcrypto, which reads its own configuration. ONNX Runtime
reads what Linux states of processors and devices below /proc and /sys, and may write to stderr where it is not there.

Signals: the library's threads block all signals but those of faults, so that they reach yours.

Windows: paths are UTF-8. Define ENDOSDK_STATIC where you link the static library. */
#ifndef ENDOSDK_H
#define ENDOSDK_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32) && defined(ENDOSDK_BUILDING)
#define ENDO_API __declspec(dllexport)
#elif defined(_WIN32) && !defined(ENDOSDK_STATIC)
#define ENDO_API __declspec(dllimport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define ENDO_API __attribute__((visibility("default")))
#else
#define ENDO_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* One loaded model with its memory. */
typedef struct endo_estimator endo_estimator;

/* Frames of one camera, several in flight. */
typedef struct endo_stream endo_stream;

/* Numbers are shared with the Python package and never change; those missing here cannot come from this library. */
typedef enum endo_status {
    ENDO_OK = 0,
    ENDO_INVALID_ARGUMENT = 1,
    ENDO_INVALID_CALIBRATION = 2,        /* the numbers cannot describe a stereo rig */
    ENDO_CALIBRATION_REQUIRED = 3,       /* depth or sigma was asked for without a calibration */
    ENDO_CALIBRATION_SIZE_MISMATCH = 4,  /* the calibration is for frames of another size */
    ENDO_CALIBRATION_UNREADABLE = 5,     /* no rig file of endosdk, or one that was changed */
    ENDO_MODEL_NOT_FOUND = 6,
    ENDO_MODEL_UNREADABLE = 7,           /* no ONNX model that the runtime accepts */
    ENDO_MODEL_METADATA = 8,             /* the model lacks or contradicts what it must say of itself, or keeps
                                            weights in another file */
    ENDO_MODEL_HASH_MISMATCH = 9,        /* not the bytes that options.model_sha256 or options.public_key asks for */
    ENDO_RUNTIME_MISSING = 10,           /* no ONNX Runtime of version 1.21 or later */
    ENDO_PROVIDER_UNAVAILABLE = 12,      /* nothing falls back to another provider */
    ENDO_INFERENCE_FAILED = 13,
    ENDO_DEPENDENCY_MISSING = 15,        /* a signature is to be checked, and there is no libcrypto to do it */
    ENDO_CANCELLED = 18,
    ENDO_OUT_OF_MEMORY = 19,             /* memory, or the number of threads this process may have, is used up */
    ENDO_SELF_TEST_FAILED = 20,
    ENDO_INTERNAL = 21,                  /* a bug: please report it with endo_get_diagnostics */
    ENDO_RUNTIME_HASH_MISMATCH = 23      /* not the file that options.runtime_sha256 asks for */
} endo_status;

/* ---- Library ---- */

/* Version of the library, such as "0.1.0". */
ENDO_API const char *endo_version(void);

/* How the library was built, as JSON: version, commit, compiler, build type, sanitizers, target, instruction sets. */
ENDO_API const char *endo_build_info(void);

/* Name of a status, such as "INVALID_ARGUMENT"; "UNKNOWN" for other numbers. */
ENDO_API const char *endo_status_name(int32_t status);

/* What went wrong in this thread's last failed call; valid until its next failed call. */
ENDO_API const char *endo_last_error(void);

/* ---- Opening ---- */

typedef enum endo_log_level { ENDO_LOG_ERROR = 1, ENDO_LOG_WARNING = 2, ENDO_LOG_INFO = 3 } endo_log_level;

/* Receives one line without a newline, from any thread; it must not call the library, nor throw. No log holds pixels. */
typedef void (*endo_log_function)(void *context, int32_t level, const char *message);

/* Called once in each thread that an estimator starts, by the thread itself and before it works: the place to set its
   priority and its cores. The name is endosdk-kernels, -stream, -follow or -session, the thread's own, too. The call
   that starts the threads waits for it, so it must return soon; it must not call the library, nor throw. Kernel threads
   serve all estimators of the process: the hook is that of the estimator whose call starts them. */
typedef void (*endo_thread_function)(void *context, const char *name);

typedef struct endo_options {
    uint32_t struct_size;
    int32_t threads;             /* processor threads per stage, 1 to 256; 0: as many as cores, at most 8 */
    int32_t spinning;            /* 0: waiting network threads sleep (default); 1: they poll for a short time first */
    int32_t log_level;           /* the least severe endo_log_level that is logged; default ENDO_LOG_WARNING */
    const char *provider;        /* "cpu" (default, also NULL), another short name, such as "cuda", or the full name of an
                                    ONNX Runtime provider; docs/device/providers.md has the table */
    const char *runtime_library; /* path of libonnxruntime; NULL: see docs/c-library.md for where it is looked for */
    const char *model_sha256;    /* 64 hexadecimal digits that the model's bytes must hash to; NULL: any model */
    endo_log_function log;       /* NULL: silence */
    void *log_context;           /* handed to log */
    int32_t network_width;       /* size the network works at; 0: the model's inference width, see docs/c-library.md */
    int32_t network_height;      /* smaller is faster and finds larger disparities; maps keep the frames' size */
    double min_confidence;       /* below it a pixel has no answer, 0..1; default 0.9 */
    double min_depth_mm;         /* depth outside the range is no answer; default 0 */
    double max_depth_mm;         /* default infinity */
    double depth_unit_mm;        /* one step of depth_u16; default 0.1 */
    double deadline_ms;          /* a frame that takes longer is marked late; 0 (default): none is */
    const char *float32_model;   /* path of the same model in float32, opened instead where the processor or the provider
                                    has no fast 8-bit arithmetic (a log line says so); NULL: there is none */
    const char *float32_model_sha256; /* as model_sha256, for that file; needed with model_sha256 unless public_key is set */
    const char *const *provider_options; /* the provider's own options, each "key=value", with NULL after the last; they
                                    are passed on unchanged. NULL: none */
    const char *runtime_sha256;  /* 64 hexadecimal digits that the file runtime_library must hash to, checked before
                                    anything of it runs. NULL: any. Libraries of providers beside it are not covered */
    double max_age_ms;           /* a pair that was taken longer ago, by endo_result.stamp_ns, is STALE; every pair must
                                    then have a stamp. 0 (default): none is */
    const uint8_t *public_key;   /* 32 bytes of an Ed25519 key: the model must be signed by it. NULL: any model */
    size_t public_key_size;
    const uint8_t *signature;    /* 64 bytes, of the model's bytes: see "Signed models" in docs/model-file.md */
    size_t signature_size;
    const uint8_t *float32_model_signature; /* the same, of float32_model */
    size_t float32_model_signature_size;
    const char *crypto_library;  /* path of OpenSSL's libcrypto, 1.1.1 or 3, which checks signatures and is opened for that
                                    alone; NULL: where the system's loader looks */
    endo_thread_function thread_started; /* NULL: threads keep the priority and cores of the thread that starts them */
    void *thread_context;        /* handed to thread_started */
} endo_options;

/* Fill options with the defaults; struct_size is sizeof(endo_options). */
ENDO_API endo_status endo_options_init(endo_options *options, size_t struct_size);

/* Load a model file of at most 256 MiB. options may be NULL; on failure *estimator is NULL. */
ENDO_API endo_status endo_open_file(const char *path, const endo_options *options, endo_estimator **estimator);

/* Load a model from memory, for instance one you decrypted; the bytes may be freed afterwards. */
ENDO_API endo_status endo_open_memory(const void *data, size_t size, const endo_options *options,
                                      endo_estimator **estimator);

/* Wait for the calls that run, then free everything; NULL is allowed. No later call may use the estimator. The log and thread
   functions are not called any more, even where a stream lives on. */
ENDO_API void endo_close(endo_estimator *estimator);

/* ---- Calibration ---- */

typedef enum endo_camera_model { ENDO_PINHOLE = 0, ENDO_FISHEYE = 1 } endo_camera_model;

/* A rig by OpenCV's conventions. right_point = rotation * left_point + translation; matrices are row by row. */
typedef struct endo_calibration {
    uint32_t struct_size;
    int32_t camera_model;             /* endo_camera_model of both cameras */
    int32_t width;                    /* of the raw frames */
    int32_t height;
    int32_t left_distortion_count;    /* pinhole: 0, 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6); fisheye: 0 or 4 */
    int32_t right_distortion_count;
    double left_matrix[9];            /* fx 0 cx, 0 fy cy, 0 0 1 */
    double right_matrix[9];
    double left_distortion[8];        /* 0 past the count */
    double right_distortion[8];
    double rotation[9];
    double translation[3];            /* mm; x is negative: the right camera is on the right */
    /* The ellipses that the optics fill: middle x, y and half axes along x and y, px of the raw frame. All 0: found in
       each picture. */
    double left_field_of_view[4];
    double right_field_of_view[4];
} endo_calibration;

/* Read the rig file that Python's StereoCalibration.save writes as JSON: `text`, of `size` bytes, as it stands in the file.
   Set calibration->struct_size first. A file that states another hash than that of its content is refused. */
ENDO_API endo_status endo_read_calibration(const char *text, size_t size, endo_calibration *calibration);

/* Of the pictures that maps belong to: depth = focal_px * baseline_mm / (disparity + doffs). */
typedef struct endo_geometry {
    uint32_t struct_size;
    int32_t rectifies;                /* 1: raw frames are rectified inside; 0: the rig is rectified already */
    double focal_px;
    double baseline_mm;
    double cx;                        /* principal point of the left view */
    double cy;
    double doffs;                     /* right cx minus left cx */
    double focal_y_px;                /* focal_px, but down the columns; another number where pixels are not square */
} endo_geometry;

/* Set the rig, or remove it with NULL: frames must then be rectified and there is no depth. Next, endo_prepare. */
ENDO_API endo_status endo_set_calibration(endo_estimator *estimator, const endo_calibration *calibration);

/* Read the geometry of the rectified pair; fails without a calibration. */
ENDO_API endo_status endo_get_geometry(endo_estimator *estimator, endo_geometry *geometry);

/* ---- Frames ---- */

typedef enum endo_pixel_format { ENDO_RGB8 = 0, ENDO_BGR8 = 1, ENDO_GRAY8 = 2 } endo_pixel_format;

typedef struct endo_image {
    uint32_t struct_size;
    int32_t format;                   /* endo_pixel_format, channels interleaved */
    const uint8_t *data;              /* first pixel of the top row */
    int32_t width;
    int32_t height;
    int64_t stride;                   /* bytes from a row to the next, negative for bottom-up frames; 0: rows are tight */
} endo_image;

/* Why a pixel is not valid: bits of endo_result.reasons, such as ENDO_REASON_OCCLUDED. Each has its name, bit and meaning here;
   give ENDO_REASONS a macro of your own for a table of them. */
#define ENDO_REASONS(REASON) \
    REASON(LOW_CONFIDENCE, 1, "the network is unsure, or the two views do not match at this disparity") \
    REASON(OCCLUDED, 2, "a nearer surface covers the match in the right view") \
    REASON(OUTSIDE_OVERLAP, 4, "the right camera does not see this point, or the lens map has no source pixel") \
    REASON(OUT_OF_RANGE, 8, "no finite positive depth, or a depth outside the requested range or the range of the network") \
    REASON(SATURATED, 16, "all three colours of the left view are overexposed: glare") \
    REASON(OUTSIDE_VIEW, 32, "the left view shows no scene here: outside its field of view, or under text or a menu in both frames")

#define ENDO_REASON_BIT(name, bit, meaning) ENDO_REASON_##name = bit,
typedef enum endo_reason { ENDO_REASONS(ENDO_REASON_BIT) } endo_reason;
#undef ENDO_REASON_BIT

/* The verdict on a whole frame. It follows from the frame's causes by the table in docs/trust.md. */
typedef enum endo_quality {
    ENDO_QUALITY_OK = 0,              /* nothing is wrong with the frame */
    ENDO_QUALITY_DEGRADED = 1,        /* a cause was raised; docs/trust.md says what can be used */
    ENDO_QUALITY_INVALID = 2          /* do not use this frame: no pixel is valid, or the call failed */
} endo_quality;

/* The problems of a frame: places in endo_result.measures, and bits of endo_result.causes, 1 << cause. Later releases
   may add more, up to ENDO_MOST_CAUSES. docs/trust.md lists each measure and its remedy. */
typedef enum endo_cause {
    ENDO_CAUSE_COVERED = 0,           /* a lens is covered, dirty or without signal */
    ENDO_CAUSE_SATURATED = 1,         /* glare or too much light */
    ENDO_CAUSE_BLURRED = 2,           /* one view is out of focus or dirty */
    ENDO_CAUSE_DIM = 3,               /* there is too little light */
    ENDO_CAUSE_FROZEN = 4,            /* a camera or a grabber repeats an old image */
    ENDO_CAUSE_NOT_SIMULTANEOUS = 5,  /* the two views were taken at different times */
    ENDO_CAUSE_SAME_VIEW_TWICE = 6,   /* one camera is connected to both inputs */
    ENDO_CAUSE_SWAPPED = 7,           /* the right camera is connected to the left input */
    ENDO_CAUSE_NOT_RECTIFIED = 8,     /* the rows of the two views do not correspond */
    ENDO_CAUSE_RIG_MOVED = 9,         /* the cameras have moved since they were calibrated */
    ENDO_CAUSE_OUT_OF_RANGE = 10,     /* the surface is too near, too far, or outside the requested depths */
    ENDO_CAUSE_LOW_TEXTURE = 11,      /* there is nothing to compare in the images */
    ENDO_CAUSE_LATE = 12,             /* the frame took longer than its deadline */
    ENDO_CAUSE_VIEWS_DIFFER = 13,     /* the two views do not show the same scene */
    ENDO_CAUSE_FEW_VALID = 14,        /* few pixels are valid */
    ENDO_CAUSE_STALE = 15,            /* the pair was taken longer ago than options.max_age_ms */
    ENDO_CAUSE_REPEATED_PATTERN = 16, /* the image repeats itself, so matches may be wrong by whole periods */
    ENDO_CAUSE_SCALES_DIFFER = 17,    /* zoom or focus of the cameras differ */
    ENDO_CAUSE_INTERLACED = 18,       /* even and odd rows are of two moments */
    ENDO_CAUSE_DISTORTED = 19         /* a view is bent, or of another moment, in a part of it */
} endo_cause;

#define ENDO_MOST_CAUSES 32

/* Name of a cause, such as "COVERED"; "UNKNOWN" for other numbers. */
ENDO_API const char *endo_cause_name(int32_t cause);

/* What a result was computed with. Texts end with zero; longer ones are cut. Empty where there is none, and after a
   failure. */
typedef struct endo_identity {
    char endosdk[16];                 /* version of this library */
    char model[104];
    char model_version[32];
    char model_sha256[72];
    char calibration_sha256[72];
    char runtime[32];                 /* version of ONNX Runtime */
    char runtime_sha256[72];          /* of its library's file */
    char provider[40];                /* what computed the network, by ONNX Runtime's own name */
    char device[72];                  /* the processor of this machine, by its maker's name */
} endo_identity;

/* Maps have the size of the frames, rows without gaps. Each is yours, and NULL where you do not want it. They must be aligned
   to their type, and overlap neither each other nor a picture of the call nor a map of the estimator's frames in flight.
   When endo_predict fails, quality is ENDO_QUALITY_INVALID and frame is 0. Every pixel then reads as one without an answer, but
   for maps that were refused themselves: nothing is written to these. */
typedef struct endo_result {
    uint32_t struct_size;
    int32_t quality;                  /* out: endo_quality */
    uint64_t capacity;                /* in: pixels that each map can hold, at least width * height */
    float *disparity;                 /* px of the frames, dense: also where reasons are set */
    float *confidence;                /* probability that the disparity is right to 1/480 of the width, 2 px at 960; 0
                                         where the two views do not agree, everywhere if they show different things */
    float *depth;                     /* mm along the optical axis; NaN where reasons are set */
    float *sigma;                     /* expected absolute error of depth, mm: the scale of a Laplace law, about two thirds
                                         of the errors are smaller; NaN as depth */
    uint8_t *reasons;                 /* endo_reason bits; 0: the pixel is valid */
    uint16_t *disparity_u16;          /* disparity in steps of 1/256 px; 0: reasons are set, or it is negative or too large */
    uint16_t *depth_u16;              /* depth in steps of options.depth_unit_mm; 0 as in disparity_u16 */
    uint64_t frame;                   /* out: counts the frames of this estimator from 1; 0 when the call failed */
    double valid_share;               /* out: share of pixels that are valid */
    double rectify_ms;                /* out: time of each stage; a size's first frame builds its maps here */
    double session_ms;
    double postprocess_ms;
    int32_t late;                     /* out: 1 when the call took longer than options.deadline_ms, waiting for others included;
                                         in a stream, for the frames before */
    int32_t reserved;                 /* must be 0 */
    uint64_t causes;                  /* out: what is wrong with the frame, bits 1 << endo_cause */
    double measures[ENDO_MOST_CAUSES]; /* out: what was measured of each endo_cause; NaN where nothing was */
    /* What the pictures tell of the rig; NaN where too little could be measured. Rotations are those of the right camera
       against the calibration, about x, y and z of the rectified frame: by so much the points that it sees turned, so it
       turned the other way itself; NaN without a calibration. */
    double vertical_disparity_px;     /* out: rows that do not match, root mean square over the picture */
    double vertical_disparity_se_px;  /* out: its standard error */
    double rotation_deg[3];           /* out: of this frame alone */
    double rotation_se_deg[3];
    double steady_rotation_deg[3];    /* out: over the frames so far, corrections not counted */
    double steady_rotation_se_deg[3];
    double corrected_deg[3];          /* out: what the rectification made up for: see endo_stream_follow_rig */
    int32_t drifted;                  /* out: 1 when the steady rotation is over 0.1 degree, and no chance */
    int32_t reserved2;                /* must be 0 */
    int64_t stamp_ns;                 /* in: when the pair was taken, of CLOCK_MONOTONIC, on Windows of
                                         QueryPerformanceCounter in nanoseconds, not in the future; 0: not known */
    double age_ms;                    /* out: age of the pair when its answer was handed out; NaN without a stamp */
    endo_identity identity;           /* out */
} endo_result;

/* Allocate for frames of this size and run once, so that the first real frame is as fast as the others. The memory of the
   size before is freed: for cameras of several sizes, open an estimator each. */
ENDO_API endo_status endo_prepare(endo_estimator *estimator, int32_t width, int32_t height);

/* Compute the maps of one pair. A new frame size is prepared first. */
ENDO_API endo_status endo_predict(endo_estimator *estimator, const endo_image *left, const endo_image *right,
                                  endo_result *result);

/* Rectify one pair at its own size, as tight RGB rows: what its maps lie over, with x_right = x_left - disparity. Either
   output may be NULL; they must not overlap. capacity: bytes that each output can hold. */
ENDO_API endo_status endo_rectify(endo_estimator *estimator, const endo_image *left, const endo_image *right,
                                  uint8_t *rectified_left, uint8_t *rectified_right, size_t capacity);

/* Copy the latest pair as the network saw it, tight RGB rows at the network's size, which endo_get_diagnostics states; NULL:
   not wanted. The outputs must not overlap. capacity: bytes that each can hold. The right view of a rectified rig with doffs
   of more than 0.5 px lies doffs further left here. A frame that was cancelled or failed half-way has overwritten the pair:
   there is none then. */
ENDO_API endo_status endo_get_rectified(endo_estimator *estimator, uint8_t *left, uint8_t *right, size_t capacity);

/* Make the calls that are running or wait for their turn, and the frames in flight, end with ENDO_CANCELLED soon. From any
   thread. */
ENDO_API endo_status endo_cancel(endo_estimator *estimator);

/* ---- Streams ----

Each frame is computed on one thread, and several frames at a time. This gives the highest frame rate. The latency is one
frame's time on one thread. One thread may submit while another receives:

    endo_stream_open(estimator, 960, 720, NULL, &stream);
    while (capture(&left, &right)) endo_stream_submit(stream, &left, &right, next_free_result());
    endo_stream_end(stream);

    while (endo_stream_receive(stream, &result) == ENDO_OK && result != NULL) use(result);      (the other thread) */

/* Open a stream of frames of this size, allocate for it and run once in each of its threads, as endo_prepare does. Without
   receiving, *frames_in_flight frames can be submitted; NULL: not wanted. endo_predict may be used beside it. A later
   endo_set_calibration does not concern it. */
ENDO_API endo_status endo_stream_open(endo_estimator *estimator, int32_t width, int32_t height,
                                      int32_t *frames_in_flight, endo_stream **stream);

/* 1: temporal filter. It moves the disparity of the frame before with the surfaces, and blends it with the new one where both
   images agree. Static surfaces flicker less. 0 (default): no filter. To be chosen before the first frame. */
ENDO_API endo_status endo_stream_set_temporal(endo_stream *stream, int32_t temporal);

/* From now on, correct the rectification slowly, by at most 0.1 degree in 30 frames, where the frames show for certain that
   the right camera has turned. A warning is logged at each correction, which a thread of its own computes, with memory of its
   own. ENDO_CALIBRATION_REQUIRED without a calibration. endo_rectify does not know of it. */
ENDO_API endo_status endo_stream_follow_rig(endo_stream *stream);

/* Hand over one pair. Waits until there is room and the images were read; they may then be overwritten. The result and
   its maps must live, untouched, until endo_stream_receive returns them. */
ENDO_API endo_status endo_stream_submit(endo_stream *stream, const endo_image *left, const endo_image *right,
                                        endo_result *result);

/* Wait for the oldest frame that was not received, and point *result to the result that was submitted with it. Returns
   what endo_predict would have returned for that frame; after an error the stream goes on. *result is NULL when the
   stream has ended and nothing is left. */
ENDO_API endo_status endo_stream_receive(endo_stream *stream, endo_result **result);

/* The same with a limit of time, for a thread that has other work: wait until endo_stream_receive would return at once, but
   longest_ms at most. *ready is then 1, else 0. 0 ms: look and return. At most one minute. */
ENDO_API endo_status endo_stream_wait(endo_stream *stream, double longest_ms, int32_t *ready);

/* No frame follows: what is in flight can still be received. */
ENDO_API endo_status endo_stream_end(endo_stream *stream);

/* Wait for what is being computed and free the stream; NULL is allowed. Results that were not received stay untouched
   or hold a part of an answer. */
ENDO_API void endo_stream_close(endo_stream *stream);

/* ---- Operation ---- */

/* Send built-in pairs the whole way of a frame: a plane of known depth, twice, to a pixel, with maps that agree and the same
   bytes again; then, for a shipped model, bands of several depths, whose answer must be that of its release, to 0.2 px. */
ENDO_API endo_status endo_self_test(endo_estimator *estimator);

/* Write versions, hashes, settings, frame counts and latencies as JSON into buffer, and the size it needs, with the
   final zero byte, into *needed. Either may be NULL; a buffer that is too small is an error and left empty. */
ENDO_API endo_status endo_get_diagnostics(endo_estimator *estimator, char *buffer, size_t size, size_t *needed);

/* ---- Measuring ----

In the maps of one frame, with the rig it was computed for: any other than that of result.identity is refused. Pixels are x
and y, one after the other, of the maps: those of the rectified left view. A result needs depth and sigma; with reasons, a
refusal names why a pixel has no depth. Standard errors come from sigma: that of a depth is 1.41 sigma. How the errors of
several pixels add up, and how often the true value lies within two standard errors, is in docs/measuring.md. Errors of the
calibration are not in them. */

typedef struct endo_measured {
    uint32_t struct_size;
    int32_t reserved;                 /* must be 0 */
    double value;                     /* mm; an area: mm squared */
    double standard_error;            /* the true value lies within 1.96 of them with a probability of 95 % */
} endo_measured;

typedef struct endo_point {
    uint32_t struct_size;
    int32_t reserved;                 /* must be 0 */
    double xyz[3];                    /* mm in the rectified left camera's frame: right, down, forward */
    double covariance[9];             /* mm squared, row by row; long along the line of sight */
} endo_point;

typedef struct endo_area {
    uint32_t struct_size;
    int32_t reserved;                 /* must be 0 */
    double flat;                      /* area of the outline on the plane that fits the surface inside best, mm squared */
    double flat_standard_error;
    double relief;                    /* from the lowest to the highest place across that plane, mm, without the outermost 5 % */
    double relief_standard_error;
    double coverage;                  /* share of the pixels inside that have a depth */
} endo_area;

/* The point that a pixel shows. */
ENDO_API endo_status endo_point_at(const endo_calibration *calibration, const endo_result *result, double x, double y,
                                   endo_point *point);

/* Length of the line through the points at two pixels, which is their distance, or more, up to 10,000. */
ENDO_API endo_status endo_path_length(const endo_calibration *calibration, const endo_result *result, const double *pixels,
                                      size_t count, endo_measured *length);

/* What lies inside a polygon of 3 to 10,000 pixels that does not cross itself, holds depth on half of its pixels, and ends
   before the horizon of the plane through them. */
ENDO_API endo_status endo_area_inside(const endo_calibration *calibration, const endo_result *result, const double *pixels,
                                      size_t count, endo_area *area);

/* How a rig is rectified, by OpenCV's conventions. */
typedef struct endo_rectification {
    uint32_t struct_size;
    int32_t region[4];                /* x, y, width, height of the largest rectangle that both views cover */
    int32_t reserved;                 /* must be 0 */
    double left_rotation[9];          /* R1, R2, P1, P2 and Q of cv2.stereoRectify */
    double right_rotation[9];
    double left_projection[12];
    double right_projection[12];
    double q[16];                     /* NaN where pixels are not square, which Q takes for granted */
} endo_rectification;

/* Rectify a rig's geometry. With alpha 0, as in endo_predict, only pixels that both views have are kept; with 1 all of them. */
ENDO_API endo_status endo_get_rectification(const endo_calibration *calibration, double alpha,
                                            endo_rectification *rectification);

/* Pixels of a raw view, right: 0 or 1, to its rectified view, and back. Not a number where there is no such pixel. The
   outputs may be the inputs. */
ENDO_API endo_status endo_raw_to_rectified(const endo_calibration *calibration, double alpha, int32_t right,
                                           const double *pixels, size_t count, double *rectified);
ENDO_API endo_status endo_rectified_to_raw(const endo_calibration *calibration, double alpha, int32_t right,
                                           const double *pixels, size_t count, double *raw);

/* Points, x y z each, of the rectified left camera's frame to that of the raw left camera, for a hand-eye calibration. */
ENDO_API endo_status endo_to_raw_left(const endo_calibration *calibration, const double *points, size_t count, double *raw);

#ifdef __cplusplus
}
#endif

#endif
