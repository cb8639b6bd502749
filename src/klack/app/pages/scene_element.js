// Bodies of klack show as an element of a page: mounts the scene, tells picks, and releases the WebGL context when it goes.
export default {
  template: '<div class="k-scene-box"><p class="k-soft" role="status">{{ words }}</p><div ref="place"></div></div>',
  props: { address: String, faces: Boolean, roles: Object },
  data: () => ({ words: "Loading the bodies ..." }),
  async mounted() {
    this.gone = new AbortController();
    try {
      const [{ mount }, answer] = await Promise.all([
        import("/static/scene.js"),
        fetch(this.address, { signal: this.gone.signal }),
      ]);
      if (!answer.ok) throw new Error((await answer.text()).trim());
      const payload = await answer.json();
      if (this.gone.signal.aborted) return;
      this.scene = mount(this.$refs.place, payload, {
        theme: this.theme(), panel: this.faces, copy: this.faces,
      });
      this.words = "";
      this.scene.on("pick", (name) => this.$emit("pick", name));
      this.scene.on("hover", (name) => this.$emit("hover", name));
      if (this.roles) this.scene.setRoles(this.roles);
      // the theme button of the page changes a class of the body
      this.watcher = new MutationObserver(() => this.scene.setTheme(this.theme()));
      this.watcher.observe(document.body, { attributes: true, attributeFilter: ["class"] });
      window.klackScenes = (window.klackScenes || 0) + 1;
    } catch (error) {
      if (!this.gone.signal.aborted) this.words = `The bodies cannot be shown: ${error.message}`;
    }
  },
  beforeUnmount() {
    this.gone.abort();
    this.watcher?.disconnect();
    if (this.scene) { this.scene.dispose(); window.klackScenes -= 1; }
    this.scene = null;
  },
  watch: {
    roles(roles) { this.scene?.setRoles(roles || {}); },
  },
  methods: {
    theme() { return document.body.classList.contains("body--dark") ? "dark" : "light"; },
    highlight(name) { this.scene?.highlight(name); },
    setCut(on) { this.scene?.setCut(on); },
    setVisible(body, on) { this.scene?.setVisible(body, on); },
    state() { return this.scene?.state(); },
  },
};
