// A line that says how things stand; it changes without the page around it being drawn anew.
export default {
  template: '<div class="hm-verdict" role="status"></div>',
  props: { said: String, tone: String },
  mounted() {
    this.say(this.said, this.tone);
  },
  methods: {
    say(words, tone) {
      this.$el.textContent = words;
      this.$el.className = `hm-verdict hm-${tone}`;
    },
  },
};
