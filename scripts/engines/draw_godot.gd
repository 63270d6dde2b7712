# Draws the unit sphere in the material of res://export/ at several brightnesses, and leaves the pixels in the page's
# `homofactPixels`. With `background`, the sky itself is drawn instead.
extends Node3D

func _ready() -> void:
	var asked: Dictionary = JSON.parse_string(FileAccess.get_file_as_string("res://request.json"))
	var view := SubViewport.new()
	view.size = Vector2i(asked.size, asked.size)
	view.own_world_3d = true
	view.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	add_child(view)

	var camera := Camera3D.new()
	if asked.has("background"):
		camera.fov = 90.0
	else:
		camera.projection = Camera3D.PROJECTION_ORTHOGONAL
		camera.size = 2.0 / asked.radius
		camera.position.z = 1000.0
		camera.near = 998.0
		camera.far = 1002.0
	camera.environment = surroundings(asked)
	view.add_child(camera)
	camera.make_current()

	for lamp in asked.lights:
		var light := DirectionalLight3D.new()
		view.add_child(light)
		light.look_at_from_position(Vector3.ZERO, -Vector3(lamp[0], lamp[1], lamp[2]))
		# A surface that faces a light of energy 1 gets pi.
		light.light_energy = lamp[3] / PI
	if not asked.has("background"):
		var sphere := SphereMesh.new()
		sphere.radial_segments = 512
		sphere.rings = 256
		sphere.radius = 1.0
		sphere.height = 2.0
		var ball := MeshInstance3D.new()
		ball.mesh = sphere
		ball.material_override = load("res://export/brdf.tres")
		ball.material_override.set_shader_parameter("sky_rotation", turned(asked))
		view.add_child(ball)

	# A sky is filtered over some frames.
	for frame in asked.frames:
		await RenderingServer.frame_post_draw
	var pixels: Array[String] = []
	for exposure in asked.exposures:
		camera.environment.tonemap_exposure = exposure
		for frame in 2:
			await RenderingServer.frame_post_draw
		var image := view.get_texture().get_image()
		image.convert(Image.FORMAT_RGB8)
		pixels.append(Marshalls.raw_to_base64(image.get_data()))
	JavaScriptBridge.eval("window.homofactPixels = %s" % JSON.stringify(pixels))

func turned(asked: Dictionary) -> Vector3:
	return Vector3(asked.rotation[0], asked.rotation[1], asked.rotation[2])

func surroundings(asked: Dictionary) -> Environment:
	var around := Environment.new()
	around.background_mode = Environment.BG_COLOR
	around.background_color = Color.BLACK
	around.ambient_light_source = Environment.AMBIENT_SOURCE_DISABLED
	around.reflected_light_source = Environment.REFLECTION_SOURCE_DISABLED
	around.tonemap_mode = Environment.TONE_MAPPER_LINEAR
	if asked.has("sky"):
		var bytes := Marshalls.base64_to_raw(asked.sky[2])
		var map := Image.create_from_data(asked.sky[1], asked.sky[0], false, Image.FORMAT_RGBF, bytes)
		var panorama := PanoramaSkyMaterial.new()
		panorama.panorama = ImageTexture.create_from_image(map)
		around.sky = Sky.new()
		around.sky.sky_material = panorama
		around.sky.process_mode = Sky.PROCESS_MODE_QUALITY
		around.sky_rotation = turned(asked)
		around.background_mode = Environment.BG_SKY
		around.ambient_light_source = Environment.AMBIENT_SOURCE_SKY
		around.reflected_light_source = Environment.REFLECTION_SOURCE_SKY
	return around
