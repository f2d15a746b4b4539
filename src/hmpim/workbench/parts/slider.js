// The browser's own range input, its name, and the number that it stands for.
export default {
  template: `
    <div class="hm-slider">
      <div class="hm-row"><span>{{ words }}</span><output ref="number" class="hm-soft"></output></div>
      <input ref="hand" type="range" :min="low" :max="high" :step="step" :aria-label="words" @input="slid">
    </div>`,
  props: { words: String, low: Number, high: Number, step: Number, at: Number, said: String },
  mounted() {
    this.stand(this.at);
    this.say(this.said);
  },
  methods: {
    stand(value) {
      this.$refs.hand.value = value;
    },
    // What came out, where it was left open; else the slider's own number, which is not waited for.
    say(words) {
      this.$refs.number.textContent = words;
      this.$refs.hand.setAttribute("aria-valuetext", words);
    },
    slid() {
      const value = Number(this.$refs.hand.value);
      this.say(String(value));
      this.$emit("slid", value);
    },
  },
};
