"""The programs that run on the graphics card (or on the CPU that stands in for one)."""

DEPTH_VERTEX = """
#version 330
in vec3 position;
uniform mat4 view;
uniform mat4 clip;
out float planar;
invariant gl_Position;
void main() {
    vec4 p = view * vec4(position, 1.0);
    planar = p.z;
    gl_Position = clip * p;
}
"""

DEPTH_FRAGMENT = """
#version 330
in float planar;
out float depth;
void main() { depth = planar; }
"""

COLOUR_VERTEX = """
#version 330
in vec3 position;
in vec3 normal;
in vec3 tangent;
in vec2 uv;
in float shade;
uniform mat4 view;
uniform mat4 rig;
uniform mat4 clip;
uniform vec3 emitter[2];
uniform float falloff;
uniform float beam;
uniform float reach;
out vec2 power;
out vec3 at;
out vec3 up;
out vec3 along;
out vec2 place;
out float open;
invariant gl_Position;
void main() {
    vec4 p = view * vec4(position, 1.0);
    at = (rig * vec4(position, 1.0)).xyz;
    up = mat3(rig) * normal;
    along = mat3(rig) * tangent;
    place = uv;
    open = shade;
    // Strength of the two emitters changes slowly over a surface, so a value at every vertex is enough.
    for (int i = 0; i < 2; ++i) {
        vec3 to = emitter[i] - at;
        float far = length(to);
        power[i] = 0.5 * pow(reach / far, falloff) * pow(max(-to.z / far, 1e-4), beam);
    }
    gl_Position = clip * p;
}
"""

# Wrapped diffuse light whose red reaches further round stands in for light that travels under the surface. The
# highlight has two parts: the relief of the tissue, and the smoother film of water over it.
COLOUR_FRAGMENT = """
#version 330
in vec3 at;
in vec3 up;
in vec3 along;
in vec2 place;
in float open;
uniform sampler2D albedo;
uniform sampler2D detail;
uniform vec2 albedo_scale;
uniform vec2 detail_scale;
uniform vec3 eye;
uniform vec3 emitter[2];
uniform vec3 tint;
in vec2 power;
uniform float ambient;
uniform float reach;
uniform float roughness;
uniform float gloss;
uniform float metallic;
out vec4 light;

float lobe(float nh, float nl, float nv, float rough) {
    float a2 = rough * rough;
    a2 *= a2;
    float d = nh * nh * (a2 - 1.0) + 1.0;
    float k = 0.5 * rough * rough;
    return a2 / (12.566 * d * d * (nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
}

void main() {
    vec4 skin = texture(albedo, place * albedo_scale);
    vec4 fine = texture(detail, place * detail_scale) * 2.0 - 1.0;
    vec3 colour = skin.rgb * skin.rgb * exp(fine.r);
    vec3 n0 = normalize(up);
    vec3 t = normalize(along - n0 * dot(along, n0));
    vec3 b = cross(n0, t);
    vec3 n = normalize(n0 - (fine.g * t + fine.b * b));
    vec3 v = normalize(eye - at);
    float wet = skin.a;
    // Water fills the finest relief, so its surface is that of a coarser level of the tile.
    vec2 swell = texture(detail, place * detail_scale, 3.0).gb * 2.0 - 1.0;
    vec3 film = normalize(n0 - (1.0 - 0.4 * wet) * (swell.x * t + swell.y * b));
    float rough = clamp(roughness * (1.0 + 0.5 * fine.a) * (1.0 - 0.35 * wet), 0.2, 0.9);
    vec3 base = mix(vec3(0.028), colour, metallic);
    vec3 total = vec3(0.0);
    for (int i = 0; i < 2; ++i) {
        vec3 l = normalize(emitter[i] - at);
        vec3 h = normalize(l + v);
        float raw = dot(n, l);
        vec3 wrap = vec3(0.30, 0.14, 0.12) * (1.0 - metallic);
        vec3 diffuse = max((raw + wrap) / (1.0 + wrap), 0.0);
        vec3 spread = colour * diffuse * (1.0 - 0.9 * metallic);
        float nl = max(dot(film, l), 0.0);
        float nv = max(dot(film, v), 0.05);
        float nh = max(dot(film, h), 0.0);
        float graze = 1.0 - clamp(dot(h, v), 0.0, 1.0);
        vec3 fresnel = base + (1.0 - base) * graze * graze * graze * graze * graze;
        float shine = lobe(nh, nl, nv, rough) + (0.35 + wet) * lobe(nh, nl, nv, max(rough * 0.6, 0.19));
        total += power[i] * tint * (spread + gloss * fresnel * min(shine, 60.0) * nl * 3.1416);
    }
    vec3 bounced = ambient * colour * colour * tint * sqrt(reach / max(length(at), 1.0)) * 1.6;
    light = vec4(min((total + bounced) * open, vec3(40.0)), 1.0);
}
"""
