varying vec3 vSum;
void main() { gl_FragColor = vec4(abs(vSum), 1.0); }
