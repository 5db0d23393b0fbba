in vec3 in_normal;
in vec3 in_albedo;
vec3 vertex_normal() { return in_normal; }
vec3 vertex_albedo() { return in_albedo; }
