from .carrying import CarriedTemplate as CarriedTemplate, carry_template as carry_template
