{% autoescape false %}
{{ comment }}
#ifndef {{ stem }}_h
#define {{ stem }}_h
enum { {{ stem }}_joints = {{ names|length }}{% for part, _, rows in parts %}, {{ stem }}_{{ part }}_samples = {{ rows|length }}{% endfor %} };
static const float {{ stem }}_rate_hz = {{ facts.rate_hz }}f;
static const float {{ stem }}_period_s = {{ facts.period_s }}f;
{% for part, how, rows in parts %}
// {{ names|join(", ") }} [{{ "rad" if kind == "float" else "pulses" }}], {{ how }}
static const {{ kind }} {{ stem }}_{{ part }}[{{ rows|length }}][{{ names|length }}] = {
{% for row in rows %}
{ {{- row|join(", ") -}} },
{% endfor %}
};
{% endfor %}
#endif
{% endautoescape %}
