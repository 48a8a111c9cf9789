// a segmentation picture: each object in its flat colour
void main() { gl_FragColor = vec4(gl_FrontLightProduct[0].diffuse.rgb, 1.0); }
