/* depth_cli: one pair of pictures in, a depth (or disparity) map out.

       depth_cli model.onnx left.ppm right.ppm out.pgm                                 disparity, steps of 1/256 px
       depth_cli model.onnx left.ppm right.ppm out.pgm rig.json                        depth, steps of 0.1 mm
       depth_cli model.onnx left.ppm right.ppm out.pgm FOCAL_PX BASELINE_MM [DOFFS]    the same, of a rectified pair

   Pictures are binary PNM (PPM or PGM, 8 bits); `convert left.png left.ppm` or `pngtopnm left.png > left.ppm` makes them.
   With the rig file of raw cameras, raw frames are rectified first. The output is a 16-bit PGM in which 0 means "no answer"; of a frame that is not to be used, all are 0. ONNX Runtime is found by
   ENDOSDK_ORT_LIBRARY or as the system does. MODEL_SHA256 in the environment pins the model. */
#include <endosdk/endosdk.h>

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct picture {
    endo_pixel_format format;
    int width;
    int height;
    uint8_t *pixels;
} picture;

static void stop(const char *what, const char *why) {
    fprintf(stderr, "depth_cli: %s: %s\n", what, why);
    exit(EXIT_FAILURE);
}

static void check(endo_status status, const char *what) {
    if (status != ENDO_OK) stop(what, endo_last_error());
}

/* One number of a PNM header, after white space and comments. */
static int header_number(FILE *file, const char *path) {
    int c = getc(file);
    while (isspace(c) || c == '#') {
        if (c == '#') {
            while (c != '\n' && c != EOF) c = getc(file);
        }
        c = getc(file);
    }
    int number = 0;
    if (!isdigit(c)) stop(path, "is no binary PNM file");
    for (; isdigit(c); c = getc(file)) {
        number = 10 * number + (c - '0');
        if (number > 65535) stop(path, "has a side or a depth that is too large");
    }
    return number; /* the one white space after the number is read, too */
}

static picture read_picture(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) stop(path, "cannot be opened");
    char magic[2];
    if (fread(magic, 1, 2, file) != 2 || magic[0] != 'P' || (magic[1] != '5' && magic[1] != '6')) {
        stop(path, "is no binary PNM file (P5 or P6)");
    }
    picture p;
    p.format = magic[1] == '6' ? ENDO_RGB8 : ENDO_GRAY8;
    p.width = header_number(file, path);
    p.height = header_number(file, path);
    if (header_number(file, path) != 255) stop(path, "must have 8 bits per channel");
    const size_t bytes = (size_t)p.width * (size_t)p.height * (p.format == ENDO_RGB8 ? 3 : 1);
    p.pixels = malloc(bytes > 0 ? bytes : 1);
    if (p.pixels == NULL || fread(p.pixels, 1, bytes, file) != bytes) stop(path, "is cut short");
    fclose(file);
    return p;
}

/* PGM stores 16 bits with the high byte first. */
static void write_map(const char *path, const uint16_t *map, int width, int height) {
    FILE *file = fopen(path, "wb");
    if (file == NULL) stop(path, "cannot be written");
    fprintf(file, "P5\n%d %d\n65535\n", width, height);
    for (size_t i = 0; i < (size_t)width * (size_t)height; ++i) {
        putc(map[i] >> 8, file);
        putc(map[i] & 255, file);
    }
    if (fclose(file) != 0) stop(path, "cannot be written");
}

/* The numbers of a pair that is rectified already. */
static endo_calibration rectified_rig(int width, int height, double focal_px, double baseline_mm, double doffs) {
    endo_calibration rig;
    memset(&rig, 0, sizeof rig);
    rig.struct_size = sizeof rig;
    rig.width = width;
    rig.height = height;
    rig.left_matrix[0] = rig.left_matrix[4] = focal_px;
    rig.left_matrix[2] = 0.5 * (width - 1);
    rig.left_matrix[5] = 0.5 * (height - 1);
    rig.left_matrix[8] = 1.0;
    memcpy(rig.right_matrix, rig.left_matrix, sizeof rig.right_matrix);
    rig.right_matrix[2] += doffs;
    rig.rotation[0] = rig.rotation[4] = rig.rotation[8] = 1.0;
    rig.translation[0] = -baseline_mm;
    return rig;
}

/* The rig of a file that endosdk's calibration wrote. */
static endo_calibration rig_of_file(const char *path) {
    static char text[1 << 16];
    FILE *file = fopen(path, "rb");
    if (file == NULL) stop(path, "cannot be opened");
    const size_t size = fread(text, 1, sizeof text, file);
    fclose(file);
    endo_calibration rig;
    memset(&rig, 0, sizeof rig);
    rig.struct_size = sizeof rig;
    check(endo_read_calibration(text, size, &rig), path);
    return rig;
}

static double number(const char *text) {
    char *end = NULL;
    const double value = strtod(text, &end);
    if (end == text || *end != '\0') stop("no number", text);
    return value;
}

int main(int argc, char **argv) {
    if (argc < 5 || argc > 8) {
        stop("usage", "depth_cli MODEL LEFT RIGHT OUT [RIG.json | FOCAL_PX BASELINE_MM [DOFFS]]");
    }
    const picture left = read_picture(argv[2]);
    const picture right = read_picture(argv[3]);
    const int metric = argc > 5;

    endo_options options;
    check(endo_options_init(&options, sizeof options), "options");
    options.model_sha256 = getenv("MODEL_SHA256"); /* NULL: any model */
    endo_estimator *estimator = NULL;
    check(endo_open_file(argv[1], &options, &estimator), argv[1]);
    if (metric) {
        const endo_calibration rig =
            argc == 6 ? rig_of_file(argv[5])
                      : rectified_rig(left.width, left.height, number(argv[5]), number(argv[6]), argc == 8 ? number(argv[7]) : 0.0);
        check(endo_set_calibration(estimator, &rig), "calibration");
    }

    const size_t pixels = (size_t)left.width * (size_t)left.height;
    uint16_t *map = malloc(pixels > 0 ? pixels * sizeof *map : 1);
    if (map == NULL) stop("memory", "not enough");
    endo_result result;
    memset(&result, 0, sizeof result);
    result.struct_size = sizeof result;
    result.capacity = pixels;
    *(metric ? &result.depth_u16 : &result.disparity_u16) = map;
    const endo_image views[2] = {
        {sizeof views[0], (int32_t)left.format, left.pixels, left.width, left.height, 0},
        {sizeof views[1], (int32_t)right.format, right.pixels, right.width, right.height, 0},
    };
    check(endo_predict(estimator, &views[0], &views[1], &result), "predict");
    if (result.quality == ENDO_QUALITY_INVALID) {
        memset(map, 0, pixels * sizeof *map);
        fprintf(stderr, "depth_cli: this pair must not be used:");
        for (int32_t cause = 0; cause < ENDO_MOST_CAUSES; ++cause) {
            if (result.causes >> cause & 1) fprintf(stderr, " %s", endo_cause_name(cause));
        }
        fprintf(stderr, "\n");
    }
    write_map(argv[4], map, left.width, left.height);
    printf("%s: %.1f %% of %dx%d pixels are valid, %.1f ms\n", argv[4], 100.0 * result.valid_share, left.width,
           left.height, result.rectify_ms + result.session_ms + result.postprocess_ms);

    endo_close(estimator);
    free(map);
    free(left.pixels);
    free(right.pixels);
    return result.quality == ENDO_QUALITY_INVALID ? EXIT_FAILURE : EXIT_SUCCESS;
}
